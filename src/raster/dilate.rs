//! stub
/// stub
pub fn dilate(_: &mut [[f32; 3]], _: &mut [bool], _: (u32, u32), _: u32) {}
