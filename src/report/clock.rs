//! Wall and CPU time, stage by stage.

use std::collections::BTreeMap;
use std::time::Instant;

use serde::ser::{Serialize, SerializeMap, Serializer};

use super::process::cpu_seconds;
use crate::progress::Stage;

/// A stretch of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Span {
    /// Seconds on the clock on the wall.
    pub wall_seconds: f64,
    /// Seconds of CPU time, all threads of the process together; `null` where the system does not tell.
    pub cpu_seconds: Option<f64>,
}

impl Span {
    /// Both stretches one after the other.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            wall_seconds: self.wall_seconds + other.wall_seconds,
            cpu_seconds: self.cpu_seconds.zip(other.cpu_seconds).map(|(a, b)| a + b),
        }
    }
}

/// How long a bake took. In JSON the stages stand beside the totals, in the order in which they run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeReport {
    /// From the first stage to the last, and what lies between.
    pub total: Span,
    /// The stages that ran.
    pub stages: BTreeMap<Stage, Span>,
}

impl TimeReport {
    /// Adds work that was done for `stage` after the clock had stopped.
    pub fn add(&mut self, stage: Stage, span: Span) {
        self.total = self.total.plus(span);
        self.add_to_stage(stage, span);
    }

    fn add_to_stage(&mut self, stage: Stage, span: Span) {
        self.stages.entry(stage).and_modify(|sum| *sum = sum.plus(span)).or_insert(span);
    }
}

impl Serialize for TimeReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(2 + self.stages.len()))?;
        map.serialize_entry("total_wall_seconds", &self.total.wall_seconds)?;
        map.serialize_entry("total_cpu_seconds", &self.total.cpu_seconds)?;
        for (stage, span) in &self.stages {
            map.serialize_entry(stage.name(), span)?;
        }
        map.end()
    }
}

/// A reading of both clocks.
#[derive(Clone, Copy, Debug)]
struct Reading {
    wall: Instant,
    cpu: Option<f64>,
}

impl Reading {
    fn now() -> Self {
        Self { wall: Instant::now(), cpu: cpu_seconds() }
    }

    fn until(self, later: Self) -> Span {
        Span {
            wall_seconds: later.wall.saturating_duration_since(self.wall).as_secs_f64(),
            cpu_seconds: self.cpu.zip(later.cpu).map(|(before, after)| (after - before).max(0.0)),
        }
    }
}

/// Measures a bake stage by stage.
///
/// A stage lasts until the next one begins; one that begins again goes on where it stopped.
#[derive(Debug)]
pub struct StageClock {
    started: Reading,
    current: Option<(Stage, Reading)>,
    report: TimeReport,
}

impl StageClock {
    /// Starts the clock, in no stage.
    #[must_use]
    pub fn start() -> Self {
        Self { started: Reading::now(), current: None, report: TimeReport::default() }
    }

    /// Ends the current stage and begins `stage`.
    pub fn begin(&mut self, stage: Stage) {
        let now = Reading::now();
        self.close(now);
        self.current = Some((stage, now));
    }

    /// Stops the clock.
    #[must_use]
    pub fn finish(mut self) -> TimeReport {
        let now = Reading::now();
        self.close(now);
        self.report.total = self.started.until(now);
        self.report
    }

    fn close(&mut self, now: Reading) {
        if let Some((stage, since)) = self.current.take() {
            self.report.add_to_stage(stage, since.until(now));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::thread::sleep;
    use std::time::Duration;

    use super::*;

    /// Sums of a few differences of seconds are exact to rounding.
    const ROUNDING: f64 = 1e-9;

    #[test]
    fn stages_share_the_total_between_them() {
        let mut clock = StageClock::start();
        clock.begin(Stage::Import);
        sleep(Duration::from_millis(5));
        clock.begin(Stage::Solve);
        sleep(Duration::from_millis(10));
        let time = clock.finish();

        let sum: f64 = time.stages.values().map(|span| span.wall_seconds).sum();
        assert!(time.stages[&Stage::Import].wall_seconds >= 0.005);
        assert!(time.stages[&Stage::Solve].wall_seconds >= 0.010);
        assert!(sum <= time.total.wall_seconds + ROUNDING);
    }

    #[test]
    fn a_stage_that_begins_again_goes_on() {
        let mut clock = StageClock::start();
        for stage in [Stage::Solve, Stage::Raster, Stage::Solve] {
            clock.begin(stage);
            sleep(Duration::from_millis(4));
        }
        let time = clock.finish();
        assert!(time.stages[&Stage::Solve].wall_seconds >= 0.008);
        assert_eq!(time.stages.len(), 2);
    }

    #[test]
    fn work_after_the_clock_counts_in_stage_and_total() {
        let mut time =
            TimeReport { total: Span { wall_seconds: 1.0, cpu_seconds: Some(2.0) }, stages: BTreeMap::new() };
        let written = Span { wall_seconds: 0.5, cpu_seconds: Some(0.25) };
        time.add(Stage::Export, written);
        assert_eq!(time.stages[&Stage::Export], written);
        assert_eq!(time.total, Span { wall_seconds: 1.5, cpu_seconds: Some(2.25) });
    }
}
