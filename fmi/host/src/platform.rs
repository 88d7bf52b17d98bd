//! Platforms for which an FMU can contain a library, and the folders that FMI defines for them.

use object::{Architecture, BinaryFormat, Object, ObjectSection};

/// A platform.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Platform {
    /// Linux on x86-64.
    X86_64Linux,
    /// Windows on x86-64.
    X86_64Windows,
    /// Linux on 64-bit Arm.
    Aarch64Linux,
    /// macOS on x86-64.
    X86_64Darwin,
    /// macOS on 64-bit Arm.
    Aarch64Darwin,
}

/// Names and file type of a platform.
struct PlatformFacts {
    platform: Platform,
    /// Folder of FMI 3.0 (section 2.5.1.4.1).
    tuple: &'static str,
    /// Folder of FMI 2.0 (section 2.3); it defines none for Arm, where the folder of FMI 3.0 is used, as newer
    /// importers expect.
    fmi2: &'static str,
    extension: &'static str,
    format: BinaryFormat,
    architecture: Architecture,
    /// `std::env::consts::OS` and `ARCH`.
    here: (&'static str, &'static str),
}

const FACTS: [PlatformFacts; 5] = [
    PlatformFacts {
        platform: Platform::X86_64Linux,
        tuple: "x86_64-linux",
        fmi2: "linux64",
        extension: "so",
        format: BinaryFormat::Elf,
        architecture: Architecture::X86_64,
        here: ("linux", "x86_64"),
    },
    PlatformFacts {
        platform: Platform::X86_64Windows,
        tuple: "x86_64-windows",
        fmi2: "win64",
        extension: "dll",
        format: BinaryFormat::Pe,
        architecture: Architecture::X86_64,
        here: ("windows", "x86_64"),
    },
    PlatformFacts {
        platform: Platform::Aarch64Linux,
        tuple: "aarch64-linux",
        fmi2: "aarch64-linux",
        extension: "so",
        format: BinaryFormat::Elf,
        architecture: Architecture::Aarch64,
        here: ("linux", "aarch64"),
    },
    PlatformFacts {
        platform: Platform::X86_64Darwin,
        tuple: "x86_64-darwin",
        fmi2: "darwin64",
        extension: "dylib",
        format: BinaryFormat::MachO,
        architecture: Architecture::X86_64,
        here: ("macos", "x86_64"),
    },
    PlatformFacts {
        platform: Platform::Aarch64Darwin,
        tuple: "aarch64-darwin",
        fmi2: "aarch64-darwin",
        extension: "dylib",
        format: BinaryFormat::MachO,
        architecture: Architecture::Aarch64,
        here: ("macos", "aarch64"),
    },
];

impl Platform {
    /// All platforms, in the order in which an FMU contains them.
    pub const ALL: [Self; 5] = {
        let mut all = [Self::X86_64Linux; 5];
        let mut index = 0;
        while index < all.len() {
            all[index] = FACTS[index].platform;
            index += 1;
        }
        all
    };

    fn facts(self) -> &'static PlatformFacts {
        &FACTS[self as usize]
    }

    /// Returns the platform this program was compiled for, if it is in the list.
    pub fn here() -> Option<Self> {
        let here = (std::env::consts::OS, std::env::consts::ARCH);
        FACTS.iter().find(|facts| facts.here == here).map(|facts| facts.platform)
    }

    /// Returns the name, which is the platform tuple of FMI 3.0 (section 2.5.1.4.1).
    pub fn tuple(self) -> &'static str {
        self.facts().tuple
    }

    /// Returns the file name of an installed library.
    pub fn file_name(self) -> String {
        format!("{}.{}", self.facts().tuple, self.facts().extension)
    }

    /// Returns the path inside an FMU of `version` (`"2.0"` or `"3.0"`) of the library of `identifier`.
    pub fn place(self, version: &str, identifier: &str) -> String {
        let PlatformFacts { tuple, fmi2, extension, .. } = self.facts();
        let folder = if version.starts_with('2') { fmi2 } else { tuple };
        format!("binaries/{folder}/{identifier}.{extension}")
    }

    /// Returns the platform of a shared library, from its content (ELF, PE or Mach-O); `None` for anything else, such
    /// as a truncated library or an executable with a fixed load address.
    pub fn of_library(bytes: &[u8]) -> Option<Self> {
        let file = object::File::parse(bytes).ok()?;
        let length = bytes.len() as u64;
        let whole = |(start, size): (u64, u64)| start.checked_add(size).is_some_and(|end| end <= length);
        if !file.sections().filter_map(|section| section.file_range()).all(whole) {
            return None;
        }
        let found = (file.format(), file.architecture());
        FACTS
            .iter()
            .find(|facts| (facts.format, facts.architecture) == found && file.kind() == object::ObjectKind::Dynamic)
            .map(|facts| facts.platform)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn platform_table_follows_the_platform_order() {
        for (index, platform) in Platform::ALL.into_iter().enumerate() {
            assert_eq!(platform as usize, index);
            assert!(platform.place("3.0", "x").starts_with(&format!("binaries/{}/x.", platform.tuple())));
        }
        assert_eq!(Platform::X86_64Windows.place("2.0", "x"), "binaries/win64/x.dll");
    }
}
