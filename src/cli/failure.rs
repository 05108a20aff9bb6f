//! What went wrong, as one chain of causes and an exit code.

use std::fmt::Write;

use cobake::error::Error;

/// Exit code: the work could not be done.
pub(crate) const FAILED: u8 = 1;
/// Exit code: the command line makes no sense.
pub(crate) const WRONG_USE: u8 = 2;
/// Exit code: the comparison went through and found more than it was told to allow.
pub(crate) const TOO_FAR: u8 = 3;
/// Exit code: the user asked to stop (128 + SIGINT, as shells have it).
pub(crate) const CANCELLED: u8 = 130;

/// A command line that parses but cannot be meant.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct WrongUse(pub(crate) String);

/// A figure that is above `--fail-above`.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct TooFar(pub(crate) String);

/// The exit code that tells a script what kind of failure this is.
pub(crate) fn exit_code(error: &anyhow::Error) -> u8 {
    if error.is::<WrongUse>() {
        return WRONG_USE;
    }
    if error.is::<TooFar>() {
        return TOO_FAR;
    }
    match error.downcast_ref::<Error>() {
        Some(Error::Options(_)) => WRONG_USE,
        Some(Error::Cancelled) => CANCELLED,
        _ => FAILED,
    }
}

/// The error and its causes, one a line, without a final line break. Being cancelled is no error.
pub(crate) fn chain(error: &anyhow::Error) -> String {
    if exit_code(error) == CANCELLED {
        return Error::Cancelled.to_string();
    }
    let mut text = format!("error: {error}");
    for cause in error.chain().skip(1) {
        // Writing into a string cannot fail.
        let _ = write!(text, "\n  caused by: {cause}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;
    use cobake::options::BakeOptions;

    fn wrong_option() -> anyhow::Error {
        let mut options = BakeOptions::default();
        options.max_reflectance = 1.0;
        Error::from(options.validate().expect_err("reflects all light")).into()
    }

    #[test]
    fn kinds_of_failure_have_codes_of_their_own() {
        assert_eq!(exit_code(&anyhow::anyhow!("disk full")), 1);
        assert_eq!(exit_code(&WrongUse("no".into()).into()), 2);
        assert_eq!(exit_code(&wrong_option()), 2);
        assert_eq!(exit_code(&TooFar("relL2 is 1".into()).into()), 3);
        assert_eq!(exit_code(&Error::Cancelled.into()), 130);
    }

    /// A context says where; it must not hide what.
    #[test]
    fn context_keeps_the_code() {
        let error = Err::<(), _>(wrong_option()).context("cannot bake scene.glb").expect_err("an error");
        assert_eq!(exit_code(&error), 2);
    }

    #[test]
    fn being_cancelled_is_no_error() {
        let error = anyhow::Error::from(Error::Cancelled).context("cannot bake scene.glb");
        assert_eq!(chain(&error), "cancelled; nothing was written");
    }

    #[test]
    fn chain_has_a_line_a_cause() {
        let error = std::io::Error::other("disk full");
        let error = anyhow::Error::from(error).context("cannot write out.glb");
        assert_eq!(chain(&error), "error: cannot write out.glb\n  caused by: disk full");
    }
}
