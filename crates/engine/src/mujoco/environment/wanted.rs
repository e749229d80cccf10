//! Which wheels are wanted: for which system and which Python.

use std::fmt;
use std::str::FromStr;

use super::python::{Python, PythonVersion};

/// A system that the pinned wheels exist for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WheelPlatform {
    /// Linux with glibc 2.28 or newer, x86-64.
    LinuxX86,
    /// Linux with glibc 2.28 or newer, 64-bit ARM.
    LinuxArm,
    /// macOS 11 or newer, Apple silicon.
    MacOsArm,
    /// Windows, x86-64.
    WindowsX86,
}

impl WheelPlatform {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::LinuxX86,
        Self::LinuxArm,
        Self::MacOsArm,
        Self::WindowsX86,
    ];

    /// Name, such as `linux-x86_64`.
    pub fn name(self) -> &'static str {
        match self {
            Self::LinuxX86 => "linux-x86_64",
            Self::LinuxArm => "linux-aarch64",
            Self::MacOsArm => "macos-arm64",
            Self::WindowsX86 => "windows-x86_64",
        }
    }

    /// Platform tag by which pip finds its wheels: the oldest system that both packages support.
    pub(super) fn tag(self) -> &'static str {
        match self {
            Self::LinuxX86 => "manylinux_2_28_x86_64",
            Self::LinuxArm => "manylinux_2_28_aarch64",
            Self::MacOsArm => "macosx_11_0_arm64",
            Self::WindowsX86 => "win_amd64",
        }
    }

    /// That of this machine, if it is one of them.
    fn this_machine() -> Option<Self> {
        match (std::env::consts::OS, std::env::consts::ARCH) {
            ("linux", "x86_64") => Some(Self::LinuxX86),
            ("linux", "aarch64") => Some(Self::LinuxArm),
            ("macos", "aarch64") => Some(Self::MacOsArm),
            ("windows", "x86_64") => Some(Self::WindowsX86),
            _ => None,
        }
    }
}

impl FromStr for WheelPlatform {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let named = Self::ALL.into_iter().find(|each| each.name() == text);
        named.ok_or_else(|| format!("not one of {}", Self::ALL.map(Self::name).join(", ")))
    }
}

/// Which wheels are wanted; written as the options of `needlebench doctor --download`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WheelsFor {
    /// The Python that they are for; `None` is the one that is found here.
    pub python: Option<PythonVersion>,
    /// The system that they are for; `None` is this one.
    pub platform: Option<WheelPlatform>,
}

impl WheelsFor {
    /// What a machine needs that has this Python.
    pub(super) fn this_machine(python: &Python) -> Self {
        Self {
            python: Some(python.wheels),
            platform: WheelPlatform::this_machine(),
        }
    }
}

impl fmt::Display for WheelsFor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut gap = "";
        if let Some(python) = self.python {
            write!(f, "--for-python {python}")?;
            gap = " ";
        }
        if let Some(platform) = self.platform {
            write!(f, "{gap}--for-platform {}", platform.name())?;
        }
        Ok(())
    }
}
