mod support;
use cobake::options::BakeOptions;
use glam::DVec3;
use support::{Case, Uniform, leaves, room};
#[test]
fn zz() {
    let appearance = Uniform { reflectance: 0.5, exitance: 1.0 };
    let walls = room(DVec3::ZERO, DVec3::new(1.0, 1.5, 0.7));
    let case = Case { surfaces: &walls, appearance: &appearance, lights: &[], patch_size: 0.25, threshold: 0.06 };
    let s = case.solve(&BakeOptions::default());
    println!("{:?} {:?}", s.energy, s.gathering);
    for (k, (a, d, i)) in leaves(&s.facets).iter().enumerate() { if k % 7 == 0 { println!("{a:.5} {:.5} {:.5}", d.x, i.x); } }
}
#[test]
fn zz2() {
    let appearance = Uniform { reflectance: 0.5, exitance: 1.0 };
    let walls = room(DVec3::ZERO, DVec3::new(1.0, 1.5, 0.7));
    let case = Case { surfaces: &walls, appearance: &appearance, lights: &[], patch_size: 0.25, threshold: 0.06 };
    let s = case.solve(&BakeOptions::default());
    let mut n = 0;
    for f in &s.facets { for l in f.leaves() { let e = &f.elements[l as usize]; let v: Vec<f64> = e.corners().iter().map(|&c| f.received(l, c).1.x).collect(); let m = v.iter().copied().fold(9.0, f64::min);
      if m < 0.9 && n < 14 { n += 1; println!("{v:.3?} {:.4?} {:.4?} {:?}", e.min, e.max, f.frame.normal); let mut p = e.parent; while p != u32::MAX { let e=&f.elements[p as usize]; println!("   {:.3?} {} {} {}", e.indirect.map(|c| c.x), e.min, e.max, e.samples.map(|s| f.samples[s as usize].position.to_string()).join(" ")); p = e.parent; } }
} }
}
