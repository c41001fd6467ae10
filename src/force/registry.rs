//! What contact laws exist: names, parameters, memory, how each is built. One line per law.

use super::composition::{NormalVisitor, RollingVisitor, TangentialVisitor};
pub use super::documentation::table_markdown;
use super::shear::ShearSprings;
use crate::config::{MaxwellBranch, PairConfig, Velocities};

/// From one line per law, the list of laws and the match that builds them. The line is the name of the
/// law's module in `src/force/`, under the law's role. The module holds `ENTRY`, the law as input and
/// documentation see it, and `build`, which hands the concrete law to a visitor. The name in the input is
/// `ENTRY.name`. Step by step: docs/adding_a_law.md.
macro_rules! register {
    (normal: $($normal:ident)*; tangential: $($tangential:ident)*; rolling: $($rolling:ident)*;) => {
        use super::{$($normal,)* $($tangential,)* $($rolling),*};

        static LAWS: &[LawEntry] = &[$($normal::ENTRY,)* $($tangential::ENTRY,)* $($rolling::ENTRY,)*];

        /// Builds the pair's normal law and hands it to the visitor.
        pub(super) fn build_normal<V: NormalVisitor>(pair: &PairConfig, visitor: V) -> V::Output {
            match pair.normal.law.name {
                $(name if name == $normal::ENTRY.name => $normal::build(pair, visitor),)*
                name => panic!("the registry has no normal law {name}"),
            }
        }

        /// Builds the tangential law `choice` and hands it to the visitor.
        pub(super) fn build_tangential<V: TangentialVisitor, const SPRINGS: usize>(
            pair: &PairConfig,
            choice: &LawChoice,
            shear: &ShearSprings<SPRINGS>,
            visitor: V,
        ) -> V::Output {
            match choice.law.name {
                $(name if name == $tangential::ENTRY.name => $tangential::build(pair, choice, shear, visitor),)*
                name => panic!("the registry has no tangential law {name}"),
            }
        }

        /// Builds the rolling law `choice` and hands it to the visitor.
        pub(super) fn build_rolling<V: RollingVisitor>(pair: &PairConfig, choice: &LawChoice, visitor: V) -> V::Output {
            match choice.law.name {
                $(name if name == $rolling::ENTRY.name => $rolling::build(pair, choice, visitor),)*
                name => panic!("the registry has no rolling law {name}"),
            }
        }
    };
}

register! {
    normal:
        becker_kamlah
        hertz
        maxwell_zener
        thornton
        thornton_ning;
    tangential:
        mindlin;
    rolling:
        rolling;
}

/// Every law: normal, tangential, then rolling ones.
#[must_use]
pub fn laws() -> &'static [LawEntry] {
    LAWS
}

/// The law of this name in this role.
#[must_use]
pub fn find(role: Role, name: &str) -> Option<&'static LawEntry> {
    LAWS.iter().find(|law| law.role == role && law.name == name)
}

/// The names of the laws in this role, in the order of the registry.
#[must_use]
pub fn names(role: Role) -> Vec<&'static str> {
    LAWS.iter().filter(|law| law.role == role).map(|law| law.name).collect()
}

/// Kind and range of a law's parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ParameterKind {
    /// A dimensionless number in \[min, max\].
    Number {
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
    },
    /// One of these words.
    Choice(&'static [&'static str]),
    /// true or false.
    Flag,
}

/// Value of a law's parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ParameterValue {
    /// For [`ParameterKind::Number`].
    Number(f64),
    /// For [`ParameterKind::Choice`]: index into the words.
    Choice(usize),
    /// For [`ParameterKind::Flag`].
    Flag(bool),
}

/// A parameter that a law reads from its own section of the input.
#[derive(Debug, Clone, Copy)]
pub struct ParameterSpec {
    /// Key in the input.
    pub name: &'static str,
    /// Kind and range.
    pub kind: ParameterKind,
    /// Value when the key is absent.
    pub default: ParameterValue,
    /// One line for the documentation and the commented example.
    pub doc: &'static str,
}

/// Which of the three parts of a contact a law describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Normal force.
    Normal,
    /// Tangential force.
    Tangential,
    /// Rolling and twisting moments.
    Rolling,
}

/// Keys of `[[material]]` that only some laws read; whoever gives one without such a law is warned.
pub const OPTIONAL_CONSTANTS: [&str; 3] = ["maxwell", "yield_stress", "surface_energy"];

/// A law as the input and the documentation see it.
#[derive(Debug, Clone, Copy)]
pub struct LawEntry {
    /// Key in the input, for example `hertz`.
    pub name: &'static str,
    /// Which part of the contact.
    pub role: Role,
    /// One line for the documentation.
    pub summary: &'static str,
    /// Paper key and equation.
    pub source: &'static str,
    /// Parameters in the order of [`LawChoice::values`].
    pub parameters: &'static [ParameterSpec],
    /// Constants of materials that the law reads and others leave alone, by their keys: [`OPTIONAL_CONSTANTS`].
    pub uses: &'static [&'static str],
    /// Checks the pair's properties; an error text says what is missing and the remedy.
    pub check: fn(&PairProperties) -> Result<(), String>,
}

/// A law chosen in the input with its parameters.
#[derive(Debug, Clone)]
pub struct LawChoice {
    /// The law.
    pub law: &'static LawEntry,
    /// One value per entry of `law.parameters`.
    pub values: Vec<ParameterValue>,
}

impl LawEntry {
    /// This law with every parameter at its default.
    #[must_use]
    pub fn with_defaults(&'static self) -> LawChoice {
        LawChoice { law: self, values: self.parameters.iter().map(|parameter| parameter.default).collect() }
    }
}

impl LawChoice {
    /// Switch on the dashpot of a law that declares one: a parameter `damping`, `none` or false without it.
    pub fn damp(&mut self) {
        let Some(index) = self.law.parameters.iter().position(|parameter| parameter.name == "damping") else { return };
        match (self.law.parameters[index].kind, &mut self.values[index]) {
            (ParameterKind::Flag, value) => *value = ParameterValue::Flag(true),
            (ParameterKind::Choice(words), ParameterValue::Choice(chosen)) if words[*chosen] == "none" => {
                *chosen = words.iter().position(|word| *word == "tsuji").unwrap_or(*chosen);
            }
            _ => {}
        }
    }
    /// Some force of the law may go with a velocity: it has no parameter `damping` or `damping_ratio`, or that is not `none`,
    /// false or 0.
    #[must_use]
    pub fn damps(&self) -> bool {
        let parameters = self.law.parameters.iter().zip(&self.values);
        let mut dashpots = parameters.filter(|(parameter, _)| ["damping", "damping_ratio"].contains(&parameter.name));
        dashpots.next().is_none_or(|(parameter, value)| match (parameter.kind, value) {
            (ParameterKind::Choice(words), ParameterValue::Choice(chosen)) => words[*chosen] != "none",
            (_, value) => ![ParameterValue::Flag(false), ParameterValue::Number(0.0)].contains(value),
        })
    }

    /// The word chosen for the parameter `damping`, if the law has one that takes words.
    #[must_use]
    pub fn dashpot(&self) -> Option<&'static str> {
        let mut parameters = self.law.parameters.iter().zip(&self.values);
        parameters.find_map(|(parameter, value)| match (parameter.kind, value) {
            (ParameterKind::Choice(words), ParameterValue::Choice(chosen)) if parameter.name == "damping" => {
                Some(words[*chosen])
            }
            _ => None,
        })
    }

    /// Value of a number parameter; panics on a name that the law does not declare (our own bug).
    #[must_use]
    pub fn number(&self, name: &str) -> f64 {
        match self.value(name) {
            ParameterValue::Number(v) => v,
            other => panic!("parameter {name} of {} is {other:?}, not a number", self.law.name),
        }
    }
    /// Value of a choice parameter as its word.
    #[must_use]
    pub fn word(&self, name: &str) -> &'static str {
        let index = self.index(name);
        match (self.law.parameters[index].kind, self.values[index]) {
            (ParameterKind::Choice(words), ParameterValue::Choice(i)) => words[i],
            (_, other) => panic!("parameter {name} of {} is {other:?}, not a choice", self.law.name),
        }
    }
    /// Value of a flag parameter.
    #[must_use]
    pub fn flag(&self, name: &str) -> bool {
        match self.value(name) {
            ParameterValue::Flag(v) => v,
            other => panic!("parameter {name} of {} is {other:?}, not a flag", self.law.name),
        }
    }
    fn index(&self, name: &str) -> usize {
        self.law
            .parameters
            .iter()
            .position(|p| p.name == name)
            .unwrap_or_else(|| panic!("law {} declares no parameter {name}", self.law.name))
    }
    fn value(&self, name: &str) -> ParameterValue {
        self.values[self.index(name)]
    }
}

/// Constants of a pair of materials that laws read.
#[derive(Debug, Clone, PartialEq)]
pub struct PairProperties {
    /// Names of the two materials.
    pub names: [String; 2],
    /// Young's moduli \[Pa\] (long-term with Maxwell branches).
    pub young_modulus: [f64; 2],
    /// Poisson's ratios.
    pub poisson_ratio: [f64; 2],
    /// Maxwell branches of each material.
    pub maxwell: [Vec<MaxwellBranch>; 2],
    /// Yield stresses \[Pa\].
    pub yield_stress: [Option<f64>; 2],
    /// Restitution coefficient of the pair.
    pub restitution: f64,
    /// Coulomb friction coefficient of the pair.
    pub friction: f64,
    /// Rolling friction coefficient of the pair.
    pub rolling_friction: f64,
    /// Twisting friction coefficient of the pair.
    pub twisting_friction: f64,
    /// Work of adhesion of the pair \[J/m²\].
    pub surface_energy: f64,
    /// The velocities that laws are given, of this pair as of all others.
    pub velocities: Velocities,
}

impl PairProperties {
    /// `1/E_eff = (1−ν_i²)/E_i + (1−ν_j²)/E_j` \[Pa\] (W 3.2).
    #[must_use]
    pub fn effective_young_modulus(&self) -> f64 {
        let [a, b] = [0, 1].map(|k| (1.0 - self.poisson_ratio[k] * self.poisson_ratio[k]) / self.young_modulus[k]);
        1.0 / (a + b)
    }
    /// `1/G_eff = Σ 2(2−ν)(1+ν)/E` \[Pa\] (W 3.9 with the erratum of PHYSICS.md section 1).
    #[must_use]
    pub fn effective_shear_modulus(&self) -> f64 {
        let [a, b] =
            [0, 1].map(|k| 2.0 * (2.0 - self.poisson_ratio[k]) * (1.0 + self.poisson_ratio[k]) / self.young_modulus[k]);
        1.0 / (a + b)
    }
}
