//! Warnings, each with an identifier for the guide and for silencing.

use std::borrow::Borrow;
use std::ops::Deref;

use crate::{Error, Result};

/// Severity of a warning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Results are correct; the note explains the physics of the scene.
    Note,
    /// Results may be worse than they appear.
    Warning,
}

impl Severity {
    /// Returns the word that precedes the text.
    pub fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
        }
    }
}

macro_rules! topics {
    ($($variant:ident $id:literal $meaning:literal $remedy:literal;)*) => {
        /// Topic of a warning. Every topic has an identifier, and a row in the guide (`docs/warnings.md`).
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Topic {
            $(#[doc = $meaning] $variant,)*
        }

        impl Topic {
            /// Every topic, in the order of the guide.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// Returns the identifier: `[flutter]` in messages, `--silence flutter` on the command line.
            pub fn id(self) -> &'static str {
                match self { $(Self::$variant => $id,)* }
            }

            /// Returns the meaning of the topic, a sentence for the guide.
            pub fn meaning(self) -> &'static str {
                match self { $(Self::$variant => $meaning,)* }
            }

            /// Returns the remedy, a sentence for the guide.
            pub fn remedy(self) -> &'static str {
                match self { $(Self::$variant => $remedy,)* }
            }
        }
    };
}

topics! {
    Flutter "flutter"
        "Friction makes vibration grow while contact stays closed. This is a note if contact opens before the growth \
         matters."
        "A note needs no action. For a warning, use less friction or more damping. With adaptive steps, also compare \
         with a smaller `time.tolerance`, because vibration far below the tolerance may decay in the run.";
    LockUp "lock-up"
        "Friction drives the tip into the casing faster than the casing deflects, so the contact force grows without limit \
         (self-locking). Clearances and energies are meaningless once this happens."
        "Use friction below µ*, a flexible casing, or a coating.";
    CuttingGrowth "cutting-growth"
        "While all contact nodes of a blade cut fresh coating, vibration is physically unstable and grows."
        "Use a larger `normal_ratio`, a smaller `specific_energy` or more damping.";
    StepGrowth "step-growth"
        "The fixed step itself makes vibration in sliding contact grow, by more than 1 % of the displacements that contact causes."
        "Use adaptive steps (`scheme = \"galerkin\"`) or a smaller `time.step`.";
    GrowthUnchecked "growth-unchecked"
        "The model has too many modes for the check of growth in sliding contact."
        "Check a ROM with fewer modes, or halve the step and compare the results.";
    OtherSense "other-sense"
        "The direction of rotation is opposite to that at the start, and the growth of vibration in contact that slides in this \
         direction was not checked."
        "Start one run with a speed of this sign.";
    UnresolvedModes "unresolved-modes"
        "The fixed step is too long for the highest modes. Their free motion stays exact, but their response to \
         contact forces does not."
        "Use a smaller `time.step` or adaptive steps.";
    UnresolvedFlexibility "unresolved-flexibility"
        "The fixed step leaves much of the flexibility of the contact nodes unresolved, which causes errors of a few \
         per cent."
        "Use a smaller `time.step` or adaptive steps.";
    MasslessEnergy "massless-energy"
        "`massless-boundary` with this step may add energy when contact opens and closes."
        "Use a smaller `time.step` or adaptive steps, or compare the energies with those of half the step.";
    MasslessBlades "massless-blades"
        "`massless-boundary` is proven stable for a limited number of blades in contact at the same time, not for \
         all blades."
        "Use a smaller `time.step` or adaptive steps.";
    CasingSolvability "casing-solvability"
        "With this friction coefficient, the casing's part of the contact problem is not positive semidefinite, so a \
         step may have no unique solution."
        "Use less friction. A step without a unique solution ends the run with a message.";
    FlightSolvability "flight-solvability"
        "For the contacts along the path of a free body, the contact problem cannot be proven to have a unique \
         solution."
        "Use less friction or the solver `coulomb`. A step without a solution ends the run.";
    CoarseExcitation "coarse-excitation"
        "The phase of the excitation changes too much in one fixed step, and central differences overestimate the \
         resonance."
        "Use the scheme `modal-exact` or a smaller `time.step`.";
    Sticking "sticking"
        "Tips slide more slowly than they vibrate, and the sliding law does not model sticking."
        "Use the solver `coulomb` or a higher speed.";
    StiffnessAtRest "stiffness-at-rest"
        "The rotor turns faster than a fifth of its first natural frequency, but the scene uses its stiffness at rest."
        "Reduce the blade with `--spin SPEED`, set `spin = { stiffening = true, growth = true }` for the structure, and \
         use the scheme `modal-exact` with a `time.step`. No action is needed if the scene already has the gap and the \
         stiffness at speed.";
    RigidContact "rigid-contact"
        "The quasi-static modes have no flexibility in some directions of the contact nodes, and contact in these \
         directions loses energy."
        "Use a free-interface ROM, or fewer contact nodes or patches.";
    ToleranceLimit "tolerance-limit"
        "The tolerance is smaller than the error of the shortest adaptive steps."
        "Use a smaller `time.step` or communication step, or a larger tolerance.";
    ToleranceMissed "tolerance-missed"
        "Some adaptive steps of the minimum length were accepted although they missed the tolerance."
        "Use a smaller `time.step` or a larger tolerance.";
    FilmPulls "film-pulls"
        "The solver `film` pulls at a contact node instead of pushing. The forces of individual nodes are wrong by about \
         as much as this pull."
        "Use the solver `lcp`.";
    FilmInside "film-inside"
        "The solver `film` leaves a contact node inside the surface, by at least 5 % of its clearance (for a free \
         body, by at least 20 % of a thousandth of its extent)."
        "Use the solver `lcp`.";
    CurvatureWork "curvature-work"
        "Normals that rotate within internal steps have added as much energy as the inputs or the shaft, so even the \
         sign of the net work may be wrong."
        "Use a smaller `time.step` or adaptive steps.";
    ThermalStep "thermal-step"
        "The communication step of a thermal FMU is shorter than the diffusion time of an element, so \
         surface temperatures rise too slowly."
        "Use a longer communication step with the heat averaged over it, or thinner elements.";
    LargeDisplacement "large-displacement"
        "A contact node moves so far around the axis that the linear gap formula has an error of at least 5 % of the clearance."
        "Check the loads and the clearance. At 100 % the run ends.";
    Implausible "implausible"
        "An implausible value was accepted because the scene sets `accept_implausible = true`."
        "Check the value. Without the key it is an error.";
    NoFrictionPower "no-friction-power"
        "Friction power per patch was requested, but no contact has friction."
        "Set `contact.friction`, or leave out the patches.";
    CommunicationStep "communication-step"
        "The communication step is longer than the run."
        "Use a shorter communication step.";
    InputLines "input-lines"
        "Lines of the input file are closer together than the communication step, and only values at communication \
         points count."
        "Use a shorter communication step.";
    RomAccuracy "rom-accuracy"
        "Modes of a ROM deviate from the full model by more than is usual for a good ROM."
        "Keep more modes.";
}

impl Topic {
    /// Finds the topic with an identifier.
    ///
    /// # Errors
    /// Unknown identifier, with a list of the known ones; `what` is its place.
    pub fn find(what: &str, id: &str) -> Result<Self> {
        let found = Self::ALL.iter().copied().find(|topic| topic.id() == id);
        found.ok_or_else(|| {
            let all: Vec<&str> = Self::ALL.iter().map(|topic| topic.id()).collect();
            let remedy = format!("Use one of: {}", all.join(", "));
            Error::invalid(what, format!("no warning has the identifier {id:?}"), remedy)
        })
    }
}

/// A warning: two lines for messages, and the whole text, to which it dereferences.
#[derive(Debug, Clone)]
pub struct Warning {
    topic: Topic,
    level: Severity,
    lines: [String; 2],
    text: String,
}

impl Warning {
    /// Creates a warning of two lines: problem and remedy. Neither ends with a full stop.
    pub fn new(topic: Topic, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        let lines = [problem.into(), remedy.into()];
        let text = format!("{}. {}", lines[0], lines[1]);
        Self { topic, level: Severity::Warning, lines, text }
    }

    /// Sets a longer text than the two lines, for logs and for users who want the details.
    pub fn with_text(self, text: impl Into<String>) -> Self {
        Self { text: text.into(), ..self }
    }

    /// Sets the severity.
    pub fn at_level(self, level: Severity) -> Self {
        Self { level, ..self }
    }

    /// Adds the name of a structure before its texts.
    pub fn named(self, name: &str) -> Self {
        let [problem, remedy] = self.lines;
        Self { lines: [format!("{name}: {problem}"), remedy], text: format!("{name}: {}", self.text), ..self }
    }

    /// Returns the topic.
    pub fn topic(&self) -> Topic {
        self.topic
    }

    /// Returns the severity.
    pub fn level(&self) -> Severity {
        self.level
    }

    /// Returns problem and remedy.
    pub fn lines(&self) -> &[String; 2] {
        &self.lines
    }

    /// Returns both lines with the identifier, for logs: `[flutter] ...`.
    pub fn logged(&self) -> String {
        let [problem, remedy] = &self.lines;
        format!("[{}] {problem}. {remedy}", self.topic.id())
    }
}

/// Returns the whole texts of warnings.
pub fn texts(warnings: &[Warning]) -> Vec<String> {
    warnings.iter().map(|warning| warning.text.clone()).collect()
}

impl Deref for Warning {
    type Target = str;

    fn deref(&self) -> &str {
        &self.text
    }
}

impl Borrow<str> for Warning {
    fn borrow(&self) -> &str {
        &self.text
    }
}

impl PartialEq for Warning {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl Eq for Warning {}

impl std::fmt::Display for Warning {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(&self.text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_unique_and_round_trip() {
        for (index, topic) in Topic::ALL.iter().enumerate() {
            let id = topic.id();
            assert!(id.chars().all(|letter| letter.is_ascii_lowercase() || letter == '-'), "{id}");
            assert_eq!(Topic::ALL.iter().position(|other| other.id() == id), Some(index), "{id}");
            assert_eq!(Topic::find("silence", id).unwrap(), *topic);
        }
        let error = Topic::find("`silence`", "fluter").unwrap_err().to_string();
        assert!(error.contains("\"fluter\"") && error.contains("flutter, lock-up"), "{error}");
    }

    #[test]
    fn structure_name_precedes_the_problem() {
        let warning = Warning::new(Topic::Sticking, "too slow", "turn faster").named("front");
        assert_eq!(warning.lines(), &["front: too slow".to_owned(), "turn faster".to_owned()]);
        assert_eq!(warning.logged(), "[sticking] front: too slow. turn faster");
    }
}
