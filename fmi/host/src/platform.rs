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
    /// `std::env::consts::ARCH`, and the architecture in the header of a library.
    architecture: (&'static str, Architecture),
    system: SystemFacts,
}

/// Names and file type of an operating system.
struct SystemFacts {
    /// `std::env::consts::OS`.
    name: &'static str,
    extension: &'static str,
    format: BinaryFormat,
}

const LINUX: SystemFacts = SystemFacts { name: "linux", extension: "so", format: BinaryFormat::Elf };
const WINDOWS: SystemFacts = SystemFacts { name: "windows", extension: "dll", format: BinaryFormat::Pe };
const MACOS: SystemFacts = SystemFacts { name: "macos", extension: "dylib", format: BinaryFormat::MachO };

const X86_64: (&str, Architecture) = ("x86_64", Architecture::X86_64);
const AARCH64: (&str, Architecture) = ("aarch64", Architecture::Aarch64);

/// Defines one row per platform, in the order of [`Platform`].
macro_rules! platform_facts {
    ($($platform:ident $tuple:literal $fmi2:literal $architecture:ident $system:ident;)*) => {
        [$(PlatformFacts {
            platform: Platform::$platform,
            tuple: $tuple,
            fmi2: $fmi2,
            architecture: $architecture,
            system: $system,
        }),*]
    };
}

const FACTS: [PlatformFacts; 5] = platform_facts! {
    X86_64Linux "x86_64-linux" "linux64" X86_64 LINUX;
    X86_64Windows "x86_64-windows" "win64" X86_64 WINDOWS;
    Aarch64Linux "aarch64-linux" "aarch64-linux" AARCH64 LINUX;
    X86_64Darwin "x86_64-darwin" "darwin64" X86_64 MACOS;
    Aarch64Darwin "aarch64-darwin" "aarch64-darwin" AARCH64 MACOS;
};

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
        FACTS.iter().find(|facts| (facts.system.name, facts.architecture.0) == here).map(|facts| facts.platform)
    }

    /// Returns the name, which is the platform tuple of FMI 3.0 (section 2.5.1.4.1).
    pub fn tuple(self) -> &'static str {
        self.facts().tuple
    }

    /// Returns the file name of an installed library.
    pub fn file_name(self) -> String {
        format!("{}.{}", self.facts().tuple, self.facts().system.extension)
    }

    /// Returns the path inside an FMU of `version` (`"2.0"` or `"3.0"`) of the library of `identifier`.
    pub fn place(self, version: &str, identifier: &str) -> String {
        let PlatformFacts { tuple, fmi2, system: SystemFacts { extension, .. }, .. } = self.facts();
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
        let is_dynamic = file.kind() == object::ObjectKind::Dynamic;
        let mut rows = FACTS.iter().filter(|_| is_dynamic);
        rows.find(|facts| (facts.system.format, facts.architecture.1) == found).map(|facts| facts.platform)
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
