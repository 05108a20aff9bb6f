//! Stage 4: light is shot until little is left.
pub mod emitter;
pub mod form_factor;
pub mod visible;
