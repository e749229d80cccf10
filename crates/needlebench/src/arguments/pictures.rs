//! Whether images are rendered.

use clap::Args;

use crate::output::complain;

/// Images take most of the time and of the size of results, and continuous integration rarely uses them.
#[derive(Debug, Clone, Copy, Default, Args)]
pub(crate) struct PicturesArguments {
    /// Render images even if the environment variable CI is set.
    #[arg(long)]
    pub pictures: bool,
    /// Do not render images.
    #[arg(long, conflicts_with = "pictures")]
    pub no_pictures: bool,
}

impl PicturesArguments {
    /// Whether to render images; prints a note if CI alone disables them.
    pub fn are_wanted(self, quiet: bool) -> bool {
        if self.pictures || self.no_pictures {
            return self.pictures;
        }
        let is_left_out = is_ci(std::env::var("CI").ok().as_deref());
        if is_left_out && !quiet {
            complain("images disabled because CI is set; --pictures enables them");
        }
        !is_left_out
    }
}

/// Whether a value of the variable `CI` means continuous integration.
fn is_ci(value: Option<&str>) -> bool {
    let value = value.unwrap_or_default().trim().to_ascii_lowercase();
    !["", "0", "false"].contains(&value.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ci_is_set_unless_it_is_empty_false_or_0() {
        for value in ["true", "1", "yes", "woodpecker"] {
            assert!(is_ci(Some(value)), "{value}");
        }
        for value in [
            None,
            Some(""),
            Some("false"),
            Some("False"),
            Some("0"),
            Some(" "),
        ] {
            assert!(!is_ci(value), "{value:?}");
        }
    }

    #[test]
    fn what_is_asked_for_goes_before_the_environment() {
        let asked = |pictures, no_pictures| PicturesArguments {
            pictures,
            no_pictures,
        };
        assert!(asked(true, false).are_wanted(true));
        assert!(!asked(false, true).are_wanted(true));
    }
}
