//! Charts keep apart, and every texel a lookup can touch is somebody's.
use cobake::geom::Frame;
use cobake::options::Resolution;
use cobake::surface::{Region, Surface};
use cobake::unwrap::{UnwrapOptions, unwrap};
use glam::{DVec2, DVec3};
use std::time::Instant;

struct Random(u64);
impl Random {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}

fn surface(outline: Vec<DVec2>, triangles: Vec<[DVec2; 3]>) -> Surface {
    let area = triangles.iter().map(|t| (t[1] - t[0]).perp_dot(t[2] - t[0]) / 2.0).sum();
    let region = Region { rings: vec![outline.clone()], triangles, area };
    Surface {
        placement: 0,
        material: 0,
        frame: Frame::new(DVec3::ZERO, DVec3::Z, DVec3::X),
        rings: vec![outline],
        source_triangles: vec![],
        regions: vec![region],
        area,
        double_sided: false,
    }
}
fn rectangle(w: f64, h: f64) -> Surface {
    let c = [DVec2::ZERO, DVec2::new(w, 0.0), DVec2::new(w, h), DVec2::new(0.0, h)];
    surface(c.to_vec(), vec![[c[0], c[1], c[2]], [c[0], c[2], c[3]]])
}

#[test]
fn timing() {
    let mut r = Random(88172645463325252);
    for (n, side) in [(300, 512), (3000, 1024), (3000, 2048)] {
        let s: Vec<_> = (0..n)
            .map(|i| {
                let k = if i % 20 == 0 { 10.0 } else { 1.0 };
                rectangle(k * r.between(0.01, 1.0), r.between(0.01, 1.0) * if i % 3 == 0 { 0.1 } else { 1.0 })
            })
            .collect();
        let t = Instant::now();
        let a = unwrap(&s, &UnwrapOptions { resolution: Resolution::Size(side), padding: None }).unwrap();
        let area: f64 = s.iter().map(|s| s.area).sum();
        println!(
            "{n} {side}: {} t/m, {:?}, area share {}",
            a.texels_per_metre,
            t.elapsed(),
            area * a.texels_per_metre.powi(2) / f64::from(side * side)
        );
    }
}
