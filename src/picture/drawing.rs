//! Planar meshes as pictures: filled cells, their outlines, lines on top, a row of swatches.
//!
//! Four pictures are drawn with this: a surface's elements filled by their irradiance (as in figure 5 of
//! Telea and van Overveld 1997), its Close Objects Buffers by state, the final triangles, and the charts.

use glam::DVec2;

use super::canvas::Canvas;
use super::{Colour, INK, PictureError, WHITE, png};

/// Pixels of paper around the drawing.
const BORDER: f64 = 12.0;
/// The side of a legend's swatch, pixels.
const SWATCH: f64 = 28.0;
/// The longest side that is drawn, pixels.
const LARGEST: u32 = 4096;

/// A drawing of plane polygons, the first axis to the right, the second upward.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshDrawing {
    /// Filled in this order.
    pub cells: Vec<Cell>,
    /// Drawn over the cells, in this order.
    pub lines: Vec<Line>,
    /// The colour of the cells' outlines; `None` leaves them out. Default: [`INK`].
    pub outline: Option<Colour>,
    /// Swatches below the drawing, left to right. Default: none.
    pub legend: Vec<Colour>,
    /// The drawing's longer side, pixels, `[64, 4096]`. Default: 1600.
    pub longest_side: u32,
}

/// A filled polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Its corners, plane coordinates; the last is joined to the first. Holes by the even-odd rule,
    /// joined to the outline by a line there and back.
    pub corners: Vec<DVec2>,
    /// What it is filled with.
    pub fill: Colour,
}

/// A line between two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Plane coordinates.
    pub from: DVec2,
    /// Plane coordinates.
    pub to: DVec2,
    /// Its colour.
    pub colour: Colour,
    /// Pixels.
    pub width: f64,
}

impl Default for MeshDrawing {
    fn default() -> Self {
        Self {
            cells: Vec::new(),
            lines: Vec::new(),
            outline: Some(INK),
            legend: Vec::new(),
            longest_side: 1600,
        }
    }
}

/// From plane coordinates to pixels.
struct Viewport {
    low: DVec2,
    high: DVec2,
    scale: f64,
}

impl Viewport {
    /// Everything finite that is drawn, scaled so that the longer side has `longest` pixels.
    fn around(drawing: &MeshDrawing, longest: f64) -> Self {
        let ends = drawing.lines.iter().flat_map(|l| [l.from, l.to]);
        let points = drawing.cells.iter().flat_map(|c| c.corners.iter().copied()).chain(ends);
        let (low, high) = points
            .filter(|p| p.is_finite())
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let extent = (high - low).max_element();
        if extent.is_finite() && extent > 0.0 {
            Self { low, high, scale: longest / extent }
        } else {
            Self { low: DVec2::ZERO, high: DVec2::ONE, scale: longest }
        }
    }

    fn pixel(&self, p: DVec2) -> DVec2 {
        DVec2::new(p.x - self.low.x, self.high.y - p.y) * self.scale + BORDER
    }

    /// Width and height of the drawing with its border.
    fn size(&self) -> DVec2 {
        ((self.high - self.low) * self.scale + 2.0 * BORDER).ceil()
    }
}

impl MeshDrawing {
    /// Draws everything on white paper.
    ///
    /// Lines and outlines are about a pixel wide; where cells are smaller than a few pixels the
    /// outlines get thinner, so that the fill still shows.
    ///
    /// # Errors
    ///
    /// [`PictureError::Encode`] if the encoder refuses the picture.
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        let (pixels, size) = self.pixels();
        png::encode(&pixels, size)
    }

    /// The drawing as 8-bit RGB rows, its width and its height.
    pub(super) fn pixels(&self) -> (Vec<u8>, (u32, u32)) {
        let longest = f64::from(self.longest_side.clamp(64, LARGEST)) - 2.0 * BORDER;
        let view = Viewport::around(self, longest);
        let size = view.size();
        let legend_height = if self.legend.is_empty() { 0.0 } else { SWATCH + BORDER };
        let legend_width = BORDER + self.legend.len().min(64) as f64 * (SWATCH + BORDER);
        let width = size.x.max(legend_width) as u32;
        let height = (size.y + legend_height) as u32;
        let mut canvas = Canvas::new(width, height, WHITE);

        let mut pixels = Vec::new();
        for cell in &self.cells {
            pixels.clear();
            pixels.extend(cell.corners.iter().map(|&p| view.pixel(p)));
            canvas.fill(&pixels, cell.fill);
        }
        if let Some(colour) = self.outline {
            self.cells.iter().for_each(|cell| outline(&mut canvas, cell, (&view, colour)));
        }
        for line in &self.lines {
            canvas.line((view.pixel(line.from), view.pixel(line.to)), line.width, line.colour);
        }
        for (k, &colour) in self.legend.iter().take(64).enumerate() {
            let corner = DVec2::new(BORDER + k as f64 * (SWATCH + BORDER), size.y);
            canvas.fill(&square(corner, SWATCH), INK);
            canvas.fill(&square(corner + 1.0, SWATCH - 2.0), colour);
        }
        (canvas.into_pixels(), (width, height))
    }
}

fn square(corner: DVec2, side: f64) -> [DVec2; 4] {
    [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|k| corner + side * k)
}

/// Draws a cell's outline, at most a tenth of the cell's size wide.
fn outline(canvas: &mut Canvas, cell: &Cell, (view, colour): (&Viewport, Colour)) {
    let area = crate::geom::polygon::signed_area(&cell.corners).abs();
    let width = (0.1 * area.sqrt() * view.scale).clamp(0.5, 1.0);
    for (i, &from) in cell.corners.iter().enumerate() {
        let to = cell.corners[(i + 1) % cell.corners.len()];
        canvas.line((view.pixel(from), view.pixel(to)), width, colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(drawing: &MeshDrawing) -> image::RgbImage {
        image::load_from_memory(&drawing.png().unwrap()).unwrap().into_rgb8()
    }

    fn cell(x: f64, y: f64, fill: Colour) -> Cell {
        Cell { corners: square(DVec2::new(x, y), 1.0).to_vec(), fill }
    }

    /// Two cells beside each other, one above: the second axis points up, colours arrive unchanged.
    #[test]
    fn cells_are_where_they_belong() {
        let cells =
            vec![cell(0.0, 0.0, [250, 0, 0]), cell(1.0, 0.0, [0, 250, 0]), cell(0.0, 1.0, [0, 0, 250])];
        let picture = decoded(&MeshDrawing { cells, longest_side: 224, ..MeshDrawing::default() });
        assert_eq!(picture.dimensions(), (224, 224));
        assert_eq!(picture.get_pixel(62, 162).0, [250, 0, 0]);
        assert_eq!(picture.get_pixel(162, 162).0, [0, 250, 0]);
        assert_eq!(picture.get_pixel(62, 62).0, [0, 0, 250]);
        assert_eq!(picture.get_pixel(162, 62).0, WHITE);
        assert!(picture.get_pixel(62, 112).0[2] < 100, "an outline lies between the cells");
    }

    #[test]
    fn lines_and_legend_are_drawn() {
        let line = Line { from: DVec2::ZERO, to: DVec2::new(4.0, 0.0), colour: [9, 9, 200], width: 4.0 };
        let drawing =
            MeshDrawing { lines: vec![line], legend: vec![EMPTY, NOT_EMPTY], ..MeshDrawing::default() };
        let picture = decoded(&drawing);
        assert_eq!(picture.get_pixel(800, 12).0, [9, 9, 200]);
        assert_eq!(picture.get_pixel(12 + 14, 24 + 14).0, EMPTY);
        assert_eq!(picture.get_pixel(12 + 40 + 14, 24 + 14).0, NOT_EMPTY);
    }

    #[test]
    fn nothing_and_nonsense_give_a_picture() {
        let odd = Cell { corners: vec![DVec2::NAN, DVec2::INFINITY], fill: INK };
        for cells in [vec![], vec![odd.clone()], vec![odd, cell(0.0, 0.0, INK)]] {
            decoded(&MeshDrawing { cells, ..MeshDrawing::default() });
        }
    }

    use super::super::{EMPTY, NOT_EMPTY};
}
