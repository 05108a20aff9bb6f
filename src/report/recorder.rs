//! Watches a bake on its way to the caller's progress: times stages, keeps warnings.

use super::{Report, StageClock};
use crate::progress::{Progress, Stage};

/// Passes everything on to the caller's [`Progress`], and notes the times and the warnings that the
/// report needs. The stages call this one, so that nothing has to be said twice.
pub struct Recorder<'a> {
    caller: &'a mut dyn Progress,
    clock: StageClock,
    warnings: Vec<String>,
}

impl<'a> Recorder<'a> {
    /// Starts the clock.
    pub fn new(caller: &'a mut dyn Progress) -> Self {
        Self { caller, clock: StageClock::start(), warnings: Vec::new() }
    }

    /// Stops the clock and fills in the report's `time`, `warnings` and `peak_memory_bytes`.
    pub fn finish(self, report: &mut Report) {
        report.time = self.clock.finish();
        report.warnings = self.warnings;
        report.peak_memory_bytes = super::peak_memory_bytes();
    }
}

impl Progress for Recorder<'_> {
    fn begin(&mut self, stage: Stage) {
        self.clock.begin(stage);
        self.caller.begin(stage);
    }

    fn advance(&mut self, fraction: f64) {
        self.caller.advance(fraction);
    }

    fn warn(&mut self, message: &str) {
        self.warnings.push(message.to_owned());
        self.caller.warn(message);
    }

    fn is_cancelled(&self) -> bool {
        self.caller.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Listener {
        heard: Vec<String>,
    }

    impl Progress for Listener {
        fn begin(&mut self, stage: Stage) {
            self.heard.push(stage.name().to_owned());
        }
        fn advance(&mut self, fraction: f64) {
            self.heard.push(fraction.to_string());
        }
        fn warn(&mut self, message: &str) {
            self.heard.push(message.to_owned());
        }
        fn is_cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn everything_reaches_the_caller_and_the_report() {
        let mut listener = Listener::default();
        let mut report = Report::default();
        let mut recorder = Recorder::new(&mut listener);
        recorder.begin(Stage::Solve);
        recorder.advance(0.5);
        recorder.warn("a wall reflects too much");
        assert!(recorder.is_cancelled());
        recorder.finish(&mut report);

        assert_eq!(listener.heard, ["solve", "0.5", "a wall reflects too much"]);
        assert_eq!(report.warnings, ["a wall reflects too much"]);
        assert!(report.time.stages.contains_key(&Stage::Solve));
    }
}
