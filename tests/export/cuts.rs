//! Surfaces with several charts: the output's triangles cover the source's, each in one chart.

use std::collections::BTreeSet;

use cobake::options::Topology;
use cobake::raster::Lightmap;
use cobake::unwrap::PageArea;
use glam::{DVec2, DVec3};
use serde_json::Value;

use crate::fixture::{Results, document, vectors};
use crate::pieces::{Cut, Numbers, quilt};
use crate::{Output, damage, number};

/// 32-bit positions and texture coordinates of order 1, and what borders bend to meet vertices.
const FLOAT: f64 = 4e-6;

/// An output triangle with everything that is compared.
struct Written {
    places: [DVec3; 3],
    coordinates: [DVec2; 3],
}

fn primitives(results: &Results) -> Vec<(usize, &Value)> {
    let source = &results.scene.source.json;
    let placed = results.scene.placements.iter().enumerate();
    placed.map(|(index, p)| (index, &source["meshes"][p.mesh]["primitives"][p.primitive])).collect()
}

/// A placement's primitive in the output.
fn written_primitive<'o>(results: &Results, output: &'o Output, placement: usize) -> &'o Value {
    let placement = &results.scene.placements[placement];
    let mesh = &output.json["nodes"][placement.node]["mesh"];
    &output.json["meshes"][number(mesh)]["primitives"][placement.primitive]
}

fn written(results: &Results, output: &Output, placement: usize) -> Vec<Written> {
    let primitive = written_primitive(results, output, placement);
    let places = output.floats(&primitive["attributes"]["POSITION"]);
    let coordinates = output.floats(&primitive["attributes"]["TEXCOORD_1"]);
    let indices = output.indices(primitive);
    let of = |corners: &[usize]| Written {
        places: [0, 1, 2].map(|i| DVec3::from_slice(&places[corners[i]])),
        coordinates: [0, 1, 2].map(|i| DVec2::from_slice(&coordinates[corners[i]])),
    };
    // The source's own triangles without area stay, and are nobody's concern here.
    let has_area = |c: &&[usize]| c[0] != c[1] && c[1] != c[2] && c[2] != c[0];
    indices.chunks(3).filter(has_area).map(of).collect()
}

fn area_vector([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a) / 2.0
}

/// Weights of a point of a triangle's plane.
fn weights(corners: [DVec3; 3], p: DVec3) -> [f64; 3] {
    let [a, b, c] = corners;
    let whole = area_vector(corners);
    [[p, b, c], [a, p, c], [a, b, p]].map(|part| area_vector(part).dot(whole) / whole.length_squared())
}

/// The source's triangles in node space: corners in the source's winding, its own vertices, the surface.
struct Source {
    index: usize,
    places: [DVec3; 3],
    surface: usize,
}

fn source_triangles(results: &Results, placement: usize, primitive: &Value) -> Vec<Source> {
    let scene = &results.scene;
    let positions = vectors(&scene.source, number(&primitive["attributes"]["POSITION"]));
    let placement = &scene.placements[placement];
    let of = |index: usize| {
        let surface = results.surfaces.iter().position(|s| s.source_triangles.contains(&index))?;
        let [a, b, c] = scene.triangles[index].source_vertices.map(|v| v as usize);
        let vertices = if placement.mirrored { [a, c, b] } else { [a, b, c] };
        let places = vertices.map(|v| DVec3::from(positions[v].map(f64::from)));
        Some(Source { index, places, surface })
    };
    placement.triangles.clone().filter_map(of).collect()
}

/// Where a point of a source triangle lies in its surface's plane.
fn plane_point(results: &Results, triangle: &Source, mirrored: bool, w: [f64; 3]) -> DVec2 {
    let order = if mirrored { [0, 2, 1] } else { [0, 1, 2] };
    let corners = results.scene.triangles[triangle.index].vertices;
    let frame = results.surfaces[triangle.surface].frame;
    (0..3).map(|i| w[i] * frame.project(results.scene.vertices[corners[order[i]] as usize])).sum()
}

/// How far a point is from the nearest border of its surface's charts, metres.
fn from_border(results: &Results, surface: usize, p: DVec2) -> f64 {
    let sides = results.atlas.charts_of(surface).iter().flat_map(|chart| {
        let ring = &chart.outline;
        (0..ring.len()).map(move |i| (ring[i], ring[(i + 1) % ring.len()]))
    });
    sides
        .map(|(a, b)| cobake::geom::polygon::nearest_on_segment(a, b, p).distance(p))
        .fold(f64::INFINITY, f64::min)
}

/// The documents and atlases that are tried.
fn trials() -> Vec<(String, Results)> {
    let mut trials = Vec::new();
    for cut in [Cut::Straight, Cut::Slanted, Cut::Eighths] {
        for (name, source) in [("document", document()), ("quilt", quilt(false)), ("even quilt", quilt(true))]
        {
            for seed in 1..4 {
                let results = Results::of(source_copy(&source)).cut_up(cut, 4, seed);
                trials.push((format!("{name}, {cut:?}, {seed}"), results));
            }
        }
    }
    trials
}

fn source_copy(source: &cobake::scene::SourceDocument) -> cobake::scene::SourceDocument {
    cobake::scene::SourceDocument {
        json: source.json.clone(),
        buffers: source.buffers.clone(),
        external_images: source.external_images.clone(),
    }
}

/// A point of the source lies in one output triangle, of the same side, which shows it where the chart does.
#[test]
fn every_point_is_covered_once_and_lies_in_its_chart() {
    for (name, results) in trials() {
        let output = Output::of(&results);
        let mut numbers = Numbers::new(9);
        for (placement, primitive) in primitives(&results) {
            let mirrored = results.scene.placements[placement].mirrored;
            let written = written(&results, &output, placement);
            let source = source_triangles(&results, placement, primitive);
            let whole: f64 = source.iter().map(|t| area_vector(t.places).length()).sum();
            let area: f64 = written.iter().map(|t| area_vector(t.places).length()).sum();
            assert!((area - whole).abs() < FLOAT * whole, "{name}: {area} of {whole} m²");
            for triangle in &source {
                for _ in 0..40 {
                    let (x, y) = (numbers.next(), numbers.next());
                    let w = if x + y < 1.0 { [1.0 - x - y, x, y] } else { [x + y - 1.0, 1.0 - x, 1.0 - y] };
                    let p: DVec3 = (0..3).map(|i| w[i] * triangle.places[i]).sum();
                    let plane = plane_point(&results, triangle, mirrored, w);
                    if w.iter().any(|&w| w < 1e-4)
                        || from_border(&results, triangle.surface, plane) < 2.0 * FLOAT
                    {
                        continue;
                    }
                    let at = |t: &&Written| {
                        let inside = weights(t.places, p);
                        let back: DVec3 = (0..3).map(|i| inside[i] * t.places[i]).sum();
                        inside.iter().all(|&w| w > 0.0) && back.distance(p) < FLOAT
                    };
                    let over: Vec<&Written> = written.iter().filter(at).collect();
                    assert_eq!(over.len(), 1, "{name}: triangles over {p} of triangle {}", triangle.index);
                    let front = area_vector(over[0].places).dot(area_vector(triangle.places));
                    assert!(front > 0.0, "{name}: the other side");
                    let inside = weights(over[0].places, p);
                    let found: DVec2 = (0..3).map(|i| inside[i] * over[0].coordinates[i]).sum();
                    let chart = results.atlas.chart_at(triangle.surface, plane).unwrap();
                    let side = f64::from(results.atlas.width);
                    let expected = chart.texel(plane) / side;
                    assert!(found.distance(expected) < FLOAT, "{name}: {found} is not {expected}");
                }
            }
        }
    }
}

/// Attributes are the source's, interpolated; they keep their types but for texture coordinates.
#[test]
fn attributes_are_interpolated() {
    for cut in [Cut::Straight, Cut::Slanted, Cut::Eighths] {
        let results = Results::of(quilt(false)).cut_up(cut, 4, 5);
        let output = Output::of(&results);
        let primitive = written_primitive(&results, &output, 0);
        let attribute = |name: &str| output.floats(&primitive["attributes"][name]);
        let places = attribute("POSITION");
        let (normals, tangents) = (attribute("NORMAL"), attribute("TANGENT"));
        let (sets, own) = (attribute("TEXCOORD_0"), attribute("_OWN"));
        let colours = output.elements(&primitive["attributes"]["COLOR_0"]);
        let change = output.floats(&primitive["targets"][0]["POSITION"]);
        assert!(places.len() > 100, "{cut:?}: {} vertices", places.len());
        for (i, p) in places.iter().enumerate() {
            let close = |a: f64, b: f64, by: f64| (a - b).abs() < by;
            assert!(close(own[i][0], 3.0 * p[0] - 7.0 * p[1], 4.0 * FLOAT), "{cut:?}: {:?} at {p:?}", own[i]);
            assert!(close(sets[i][0], p[0], 2e-5) && close(sets[i][1], 1.0 - p[1], 2e-5), "{cut:?}: {p:?}");
            assert!(close(change[i][0], p[1], FLOAT) && close(change[i][2], 1.0, FLOAT));
            for (colour, value) in colours[i].iter().zip([p[0], p[1], 1.0 - p[0], 1.0]) {
                assert!(close(f64::from(*colour), 255.0 * value, 1.1), "{cut:?}: {:?} at {p:?}", colours[i]);
            }
            let normal = DVec3::from_slice(&normals[i]);
            let meant = DVec3::new(p[0] - 0.5, p[1] - 0.5, 2.0).normalize();
            assert!(close(normal.length(), 1.0, 1e-6) && normal.distance(meant) < 0.01, "{cut:?}: {normal}");
            let tangent = DVec3::from_slice(&tangents[i]);
            let meant = DVec3::new(1.0, p[0] - 0.5, 0.0).normalize();
            assert!(
                close(tangent.length(), 1.0, 1e-6) && tangent.distance(meant) < 0.01,
                "{cut:?}: {tangent}"
            );
            assert_eq!(tangents[i][3], -1.0);
        }
        let accessor = |name: &str| &output.json["accessors"][number(&primitive["attributes"][name])];
        assert_eq!(accessor("TEXCOORD_0")["componentType"], 5126);
        assert!(accessor("TEXCOORD_0").get("normalized").is_none());
        assert_eq!(
            (&accessor("COLOR_0")["componentType"], &accessor("COLOR_0")["type"]),
            (&5121.into(), &"VEC4".into())
        );
        // The source's own vertices are all there, bit for bit.
        let source = &results.scene.source;
        for vertex in vectors(source, number(&primitives(&results)[0].1["attributes"]["POSITION"])) {
            assert!(places.contains(&vertex.map(f64::from).to_vec()), "{cut:?}: {vertex:?} is lost");
        }
    }
}

/// No vertex lies inside an edge of another triangle of its surface, and none has next to no area.
#[test]
fn cuts_conform() {
    for (name, results) in trials() {
        let output = Output::of(&results);
        for (placement, primitive) in primitives(&results) {
            let written = written(&results, &output, placement);
            for surface in 0..results.surfaces.len() {
                let source = source_triangles(&results, placement, primitive);
                let Some(own) = source.iter().find(|t| t.surface == surface) else { continue };
                let normal = area_vector(own.places).normalize();
                let in_plane =
                    |t: &&Written| t.places.iter().all(|p| (*p - own.places[0]).dot(normal).abs() < FLOAT);
                check_edges(&name, &written.iter().filter(in_plane).collect::<Vec<_>>());
            }
        }
    }
}

fn check_edges(name: &str, triangles: &[&Written]) {
    let places: BTreeSet<[u64; 3]> =
        triangles.iter().flat_map(|t| t.places).map(|p| p.to_array().map(f64::to_bits)).collect();
    let places: Vec<DVec3> = places.into_iter().map(|p| p.map(f64::from_bits).into()).collect();
    for (i, p) in places.iter().enumerate() {
        let twin = places[i + 1..].iter().find(|q| q.distance(*p) < 3e-7);
        assert_eq!(twin, None, "{name}: almost {p}");
    }
    for one in triangles {
        let longest = (0..3).map(|k| one.places[k].distance(one.places[(k + 1) % 3])).fold(0.0, f64::max);
        let height = 2.0 * area_vector(one.places).length() / longest;
        assert!(height > 3e-7, "{name}: a triangle {longest} m long is {height} m high");
        for k in 0..3 {
            let (a, b) = (one.places[k], one.places[(k + 1) % 3]);
            for &p in &places {
                let share = (p - a).dot(b - a) / (b - a).length_squared();
                let inside = share * a.distance(b) > 1e-7 && (1.0 - share) * a.distance(b) > 1e-7;
                let apart = p.distance(a.lerp(b, share));
                assert!(!inside || apart > 3e-7, "{name}: {p} lies inside the edge from {a} to {b}");
            }
        }
    }
}

/// A triangle that no border crosses is as it was; those that are crossed become few.
#[test]
fn few_triangles_are_added() {
    let results = Results::of(quilt(true)).cut_up(Cut::Eighths, 0, 1);
    let output = Output::of(&results);
    let whole = written(&results, &output, 0).len();
    let one_cut = Results::of(quilt(true)).cut_up(Cut::Straight, 1, 1);
    let output = Output::of(&one_cut);
    let after = written(&one_cut, &output, 0);
    // One column of six quads is crossed: of its twelve triangles each becomes three.
    assert_eq!((whole, after.len()), (72, 72 + 2 * 12));
    let indices = written_primitive(&one_cut, &output, 0);
    assert_eq!(output.json["accessors"][number(&indices["indices"])]["componentType"], 5123);
}

/// Where a cut ends on an edge that another surface has as well, both have the vertex, bit for bit: in
/// another primitive, and around the corner of a cube.
#[test]
fn neighbours_take_the_cuts_of_their_edges() {
    for cut in [Cut::Straight, Cut::Slanted, Cut::Eighths] {
        let results = Results::of(quilt(false)).cut_up_some(cut, 5, 4, |surface| surface == 0);
        let output = Output::of(&results);
        let [quilt, wall] = [0, 1].map(|placement| {
            let corners = written(&results, &output, placement).into_iter().flat_map(|t| t.places);
            let shared = corners.filter(|p| p.y == 0.0 && p.z == 0.0).map(|p| p.x.to_bits());
            shared.collect::<BTreeSet<_>>()
        });
        assert!(quilt.len() > 7, "{cut:?}: the quilt is cut at the wall");
        assert_eq!(quilt, wall, "{cut:?}");

        let results = Results::of(document()).cut_up_some(cut, 3, 4, |surface| surface == 2);
        let output = Output::of(&results);
        let cube = written(&results, &output, 0);
        let places: Vec<DVec3> = cube.iter().flat_map(|t| t.places).collect();
        assert!(places.iter().any(|p| p.abs().min_element() < 0.5 - FLOAT && p.abs().max_element() == 0.5));
        for triangle in &cube {
            for k in 0..3 {
                let (a, b) = (triangle.places[k], triangle.places[(k + 1) % 3]);
                let inside = places.iter().find(|p| {
                    let share = (**p - a).dot(b - a) / (b - a).length_squared();
                    share > 1e-6 && share < 1.0 - 1e-6 && p.distance(a.lerp(b, share)) < 1e-7
                });
                assert_eq!(inside, None, "{cut:?}: a vertex inside the edge from {a} to {b}");
            }
        }
    }
}

/// The radiosity mesh is cut alike, its solution interpolated.
#[test]
fn the_adaptive_mesh_is_cut_too() {
    for cut in [Cut::Straight, Cut::Slanted, Cut::Eighths] {
        let mut results = Results::of(document()).cut_up(cut, 4, 6);
        results.options.topology = Topology::Adaptive;
        let output = Output::of(&results);
        let (document, ..) = gltf::import_slice(cobake::export::encode(&results.baked()).unwrap()).unwrap();
        let mut numbers = Numbers::new(4);
        for (placement, name) in [(2, "floor"), (3, "strip"), (4, "wall")] {
            let node = document.nodes().find(|node| node.name() == Some(name)).unwrap();
            let world = glam::Mat4::from_cols_array_2d(&node.transform().matrix()).as_dmat4();
            let mut written = written(&results, &output, placement);
            for place in written.iter_mut().flat_map(|t| &mut t.places) {
                *place = world.transform_point3(*place);
            }
            let attributes = &written_primitive(&results, &output, placement)["attributes"];
            let places = output.floats(&attributes["POSITION"]);
            for (place, light) in places.iter().zip(output.floats(&attributes["_IRRADIANCE"])) {
                let meant = world.transform_point3(DVec3::from_slice(place)).abs() + 1.0;
                assert!(
                    DVec3::from_slice(&light).distance(meant) < FLOAT,
                    "{cut:?}, {name}: {light:?}, {meant}"
                );
            }
            for (index, surface) in results.surfaces.iter().enumerate().filter(|s| s.1.placement == placement)
            {
                let on = |t: &&Written| t.places.iter().all(|p| surface.frame.height(*p).abs() < FLOAT);
                let own: Vec<&Written> = written.iter().filter(on).collect();
                assert!(own.len() > 20, "{cut:?}, {name}: {} triangles", own.len());
                let area: f64 = own.iter().map(|t| area_vector(t.places).dot(surface.frame.normal)).sum();
                assert!((area - surface.area).abs() < FLOAT * area, "{cut:?}, {name}: {area} m²");
                check_edges(&format!("{cut:?}, {name}"), &own);
                let (low, high) = surface.extent();
                for _ in 0..200 {
                    let p = low + (high - low) * DVec2::new(numbers.next(), numbers.next());
                    if from_border(&results, index, p) < 4.0 * FLOAT {
                        continue;
                    }
                    let at =
                        |t: &&&Written| weights(t.places, surface.frame.lift(p)).iter().all(|&w| w > 0.0);
                    let over: Vec<_> = own.iter().filter(at).collect();
                    if over.is_empty() {
                        continue; // on an edge; that all is covered, the areas say
                    }
                    assert_eq!(over.len(), 1, "{cut:?}, {name}: triangles over {p}");
                    let inside = weights(over[0].places, surface.frame.lift(p));
                    let found: DVec2 = (0..3).map(|i| inside[i] * over[0].coordinates[i]).sum();
                    let expected =
                        results.atlas.chart_at(index, p).unwrap().texel(p) / f64::from(results.atlas.width);
                    assert!(found.distance(expected) < FLOAT, "{cut:?}, {name}: {found} is not {expected}");
                }
            }
        }
    }
}

#[test]
fn bytes_of_cuts_repeat() {
    for topology in [Topology::Source, Topology::Adaptive] {
        let encode = || {
            let mut results = Results::of(quilt(false)).cut_up(Cut::Slanted, 4, 2);
            results.options.topology = topology;
            cobake::export::encode(&results.baked()).unwrap()
        };
        let first = encode();
        assert!((0..3).all(|_| encode() == first));
    }
}

/// Outlines that are none, and documents with a number that is nonsense, end in a file or an error.
#[test]
fn bad_cuts_never_panic() {
    let changes: [fn(&mut Vec<DVec2>); 6] = [
        Vec::clear,
        |ring| ring.truncate(2),
        |ring| ring[0] = DVec2::NAN,
        |ring| ring[1] = DVec2::INFINITY,
        |ring| ring.reverse(),
        |ring| ring.iter_mut().for_each(|p| *p *= 1e-30),
    ];
    for topology in [Topology::Source, Topology::Adaptive] {
        for change in changes {
            let mut results = Results::of(quilt(false)).cut_up(Cut::Slanted, 3, 2);
            results.options.topology = topology;
            results.atlas.charts.iter_mut().step_by(2).for_each(|chart| change(&mut chart.outline));
            Output::of(&results);
        }
    }
    let mut results = Results::of(quilt(false)).cut_up(Cut::Slanted, 2, 2);
    results.lightmap = Lightmap { width: 1, height: 1, texels: vec![[1.0; 3]] };
    results.atlas.pages = vec![PageArea { row: 0, width: 1, height: 1 }];
    let whole = results.scene.source.json.clone();
    let (mut written, mut refused) = (0, 0);
    for by in [0.into(), 3.into(), (-1).into(), 1_000_000.into()] {
        for number in 0.. {
            results.scene.source.json = whole.clone();
            if !damage(&mut results.scene.source.json, &mut { number }, &by) {
                break;
            }
            match cobake::export::encode(&results.baked()) {
                Ok(_) => written += 1,
                Err(_) => refused += 1,
            }
        }
    }
    assert!(written > 20 && refused > 20, "{written} written, {refused} refused");
}
