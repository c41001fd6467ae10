//! Physical dimensions as integer powers of the SI base units.

/// Powers of metre, kilogram, second, kelvin and ampere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dimension(pub [i8; 5]);

impl Dimension {
    /// A plain number.
    pub const NONE: Self = Self([0, 0, 0, 0, 0]);
    /// m
    pub const LENGTH: Self = Self([1, 0, 0, 0, 0]);
    /// kg
    pub const MASS: Self = Self([0, 1, 0, 0, 0]);
    /// s
    pub const TIME: Self = Self([0, 0, 1, 0, 0]);
    /// m/s
    pub const VELOCITY: Self = Self([1, 0, -1, 0, 0]);
    /// m/s²
    pub const ACCELERATION: Self = Self([1, 0, -2, 0, 0]);
    /// kg/m³
    pub const DENSITY: Self = Self([-3, 1, 0, 0, 0]);
    /// Pa
    pub const PRESSURE: Self = Self([-1, 1, -2, 0, 0]);
    /// Pa s
    pub const VISCOSITY: Self = Self([-1, 1, -1, 0, 0]);
    /// 1/s: strain rates and angular velocities
    pub const RATE: Self = Self([0, 0, -1, 0, 0]);
    /// J/m² = N/m
    pub const SURFACE_ENERGY: Self = Self([0, 1, -2, 0, 0]);
    /// N
    pub const FORCE: Self = Self([1, 1, -2, 0, 0]);

    /// Dimensions with a name of their own: dimension, name with article, SI unit.
    const NAMED: [(Self, &'static str, &'static str); 12] = [
        (Self::NONE, "a plain number", ""),
        (Self::LENGTH, "a length", "m"),
        (Self::MASS, "a mass", "kg"),
        (Self::TIME, "a time", "s"),
        (Self::VELOCITY, "a velocity", "m/s"),
        (Self::ACCELERATION, "an acceleration", "m/s^2"),
        (Self::DENSITY, "a density", "kg/m^3"),
        (Self::PRESSURE, "a pressure", "Pa"),
        (Self::VISCOSITY, "a viscosity", "Pa s"),
        (Self::RATE, "a rate", "1/s"),
        (Self::FORCE, "a force", "N"),
        (Self::SURFACE_ENERGY, "a surface energy", "J/m^2"),
    ];

    /// The SI unit as text that the parser accepts; empty for plain numbers.
    #[must_use]
    pub fn unit(self) -> String {
        if let Some((_, _, unit)) = Self::NAMED.iter().find(|(d, _, _)| *d == self) {
            return (*unit).to_owned();
        }
        let factors = ["m", "kg", "s", "K", "A"].iter().zip(self.0).filter(|(_, power)| *power != 0);
        factors
            .map(|(symbol, power)| if power == 1 { (*symbol).to_owned() } else { format!("{symbol}^{power}") })
            .collect::<Vec<_>>()
            .join(" ")
    }

    /// For messages: `a pressure (Pa)`, `a plain number`, `a quantity in kg^2 s`.
    #[must_use]
    pub fn describe(self) -> String {
        match Self::NAMED.iter().find(|(d, _, _)| *d == self) {
            Some((_, name, "")) => (*name).to_owned(),
            Some((_, name, unit)) => format!("{name} ({unit})"),
            None => format!("a quantity in {}", self.unit()),
        }
    }

    /// `self · other^power`; `None` when a power leaves the representable range.
    pub(super) fn times(self, other: Self, power: i32) -> Option<Self> {
        let mut result = self;
        for (target, factor) in result.0.iter_mut().zip(other.0) {
            let sum = i32::from(*target).checked_add(i32::from(factor).checked_mul(power)?)?;
            *target = i8::try_from(sum).ok()?;
        }
        Some(result)
    }
}
