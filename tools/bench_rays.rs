//! How fast rays are, singly and as fans, in a scene: millions a second on one core, and the ratio.
//!
//! `cargo run --release --example bench_rays [SCENE.glb]`

use std::hint::black_box;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use cobake::scene::{ImportOptions, load};
use cobake::solve::hemisphere::{Directions, Level};
use cobake::solve::sequence;
use cobake::trace::{FAN, FanStack, Tracer};
use glam::DVec3;

/// Places on the scene's surfaces from which rays go out; whole fans of them.
const PLACES: u32 = 1984;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "fixtures/desk/scene.glb".into());
    let scene = load(Path::new(&path), &ImportOptions::default())?;
    let triangles: Vec<[DVec3; 3]> =
        scene.triangles.iter().map(|t| t.vertices.map(|v| scene.vertices[v as usize])).collect();
    let places = places(&triangles);
    let tracer = Tracer::new(triangles);
    let mut out = std::io::stdout().lock();
    writeln!(out, "{path}: {} triangles, millions of rays a second", tracer.triangles().len())?;
    writeln!(out, "{:34} {:>8} {:>8} {:>6}", "", "singly", "as fans", "ratio")?;
    let directions = Directions::prepare();
    for rays in [64.0, 256.0, 1024.0] {
        let level = Level::of(rays);
        let fans = directions.fans(level);
        let count = f64::from(PLACES) * level.rays() as f64;
        let singly = rate(count, || {
            for (origin, axes) in &places {
                for fan in fans {
                    for ray in 0..FAN {
                        let d = fan.direction(ray);
                        let towards = d.x * axes[0] + d.y * axes[1] + d.z * axes[2];
                        black_box(tracer.closest_hit(*origin, towards));
                    }
                }
            }
        });
        let mut stack = FanStack::default();
        let as_fans = rate(count, || {
            for (origin, axes) in &places {
                tracer.look(*origin, *axes, fans, &mut stack, |hit, _, _| {
                    black_box(hit);
                });
            }
        });
        let name = format!("hemisphere of {}, nearest hit", level.rays());
        writeln!(out, "{name:34} {singly:8.2} {as_fans:8.2} {:6.2}", as_fans / singly)?;
    }
    let mut stack = FanStack::default();
    let targets: Vec<DVec3> = places.iter().map(|(p, _)| *p).collect();
    let count = f64::from(PLACES) * FAN as f64;
    let to = |i: usize| &targets[(i / FAN + 1) * FAN % targets.len()..][..FAN];
    let singly = rate(count, || {
        for (i, (origin, _)) in places.iter().enumerate() {
            for &target in to(i) {
                black_box(tracer.occluded(*origin, target));
            }
        }
    });
    let as_fans = rate(count, || {
        for (i, (origin, _)) in places.iter().enumerate() {
            black_box(tracer.arriving_all(*origin, to(i), &mut stack));
        }
    });
    let name = "shadow rays to 16 near points";
    writeln!(out, "{name:34} {singly:8.2} {as_fans:8.2} {:6.2}", as_fans / singly)?;
    Ok(())
}

/// Millions a second, the best of three.
fn rate(count: f64, mut work: impl FnMut()) -> f64 {
    let seconds = (0..3).map(|_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    });
    count * 1e-6 / seconds.fold(f64::INFINITY, f64::min)
}

/// Points spread over the triangles, just off them, with axes whose last is the normal.
fn places(triangles: &[[DVec3; 3]]) -> Vec<(DVec3, [DVec3; 3])> {
    let area = |t: &[DVec3; 3]| 0.5 * (t[1] - t[0]).cross(t[2] - t[0]).length();
    let whole: f64 = triangles.iter().map(area).sum();
    let (mut places, mut before) = (Vec::new(), 0.0);
    for t in triangles {
        let normal = (t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero();
        let until = before + area(t) / whole * f64::from(PLACES);
        for k in before.ceil() as u32..until.ceil() as u32 {
            let [u, v, ..] = sequence::point(k, 5);
            let r = u.sqrt();
            let point = t[0] * (1.0 - r) + t[1] * (r * (1.0 - v)) + t[2] * (r * v);
            let u = normal.any_orthonormal_vector();
            places.push((point + normal * 1e-4 * whole.sqrt(), [u, normal.cross(u), normal]));
        }
        before = until;
    }
    places.truncate(PLACES as usize);
    places
}
