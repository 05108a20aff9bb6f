//! Where other methods fail: each case asserts how exact the light is, and that nothing panics, is not a
//! number, or loses energy. Whole bakes, seen as a viewer sees them: bilinearly.

// Clippy lets tests expect things, but not the functions that tests share.
#![allow(clippy::expect_used, clippy::unwrap_used, clippy::panic)]

#[allow(dead_code, reason = "import's tests use the rest")]
#[path = "../import/draft.rs"]
mod draft;
#[path = "../support/model.rs"]
mod model;
#[path = "../support/rectangles.rs"]
mod rectangles;

mod blocker;
mod contact;
mod degenerate;
mod density;
mod emitter;
mod gap;
mod growth;
mod nothing;
mod placing;
mod sealed;
mod tube;
