mod support;
use cobake::trace::Tracer;
use glam::DVec3;
use support::room;
#[test]
fn zz3() {
    let walls = room(DVec3::ZERO, DVec3::new(1.0, 1.5, 0.7));
    let t: Vec<[DVec3; 3]> = walls.iter().flat_map(|s| s.regions[0].triangles.iter().map(|t| t.map(|p| s.frame.lift(p)))).collect();
    let tracer = Tracer::new(t);
    let o = DVec3::new(1.93e-5, 0.7, 7.7e-6);
    let (mut miss, mut back, mut far) = (0, 0, 0);
    for i in 0..1000 { let a = i as f64 * 0.618; let r = ((i as f64 + 0.5) / 1000.0).sqrt(); let d = DVec3::new(r * (a * 6.283).cos(), r * (a * 6.283).sin(), (1.0 - r * r).sqrt());
        let expect = if d.x < 0.0 { 1.93e-5 / -d.x } else { 9.0 };
        match tracer.closest_hit(o, d) { None => miss += 1, Some(h) => { if h.from_behind { back += 1; } if d.x < 0.0 && h.distance > expect * 1.1 { far += 1; if far < 5 { println!("{d} {h:?} {expect}"); } } } } }
    println!("miss {miss} back {back} far {far}");
}
