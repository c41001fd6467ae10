//! Which column of a particle table means what, and in which unit.

use super::Problems;

/// What a column of numbers holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    Position,
    Radius,
    SemiAxis,
    Orientation,
    Velocity,
    Spin,
}

/// A column of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name in the file.
    pub name: String,
    pub quantity: Quantity,
    /// Component; 0 for radii, w, x, y, z for orientations.
    pub axis: usize,
    /// The file's value over this is the SI value. (Dividing by a power of ten rounds once; multiplying
    /// by its inverse would round twice.)
    pub divisor: f64,
}

impl Column {
    pub fn to_si(&self, value: f64) -> f64 {
        value / self.divisor
    }
}

/// The columns of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    /// Position of the column of species names among all columns.
    pub species: usize,
    /// Columns of numbers, each with its position among all columns.
    pub positions: Vec<usize>,
    pub numbers: Vec<Column>,
}

const FIELDS: [(&str, Quantity, usize); 17] = [
    ("x", Quantity::Position, 0),
    ("y", Quantity::Position, 1),
    ("z", Quantity::Position, 2),
    ("radius", Quantity::Radius, 0),
    ("a", Quantity::SemiAxis, 0),
    ("b", Quantity::SemiAxis, 1),
    ("c", Quantity::SemiAxis, 2),
    ("qw", Quantity::Orientation, 0),
    ("qx", Quantity::Orientation, 1),
    ("qy", Quantity::Orientation, 2),
    ("qz", Quantity::Orientation, 3),
    ("vx", Quantity::Velocity, 0),
    ("vy", Quantity::Velocity, 1),
    ("vz", Quantity::Velocity, 2),
    ("wx", Quantity::Spin, 0),
    ("wy", Quantity::Spin, 1),
    ("wz", Quantity::Spin, 2),
];

impl Columns {
    /// Understand the names of all columns.
    ///
    /// # Errors
    /// A text with every unknown, repeated or missing name and its remedy.
    pub fn from_names(names: &[String]) -> Result<Self, String> {
        let mut problems = Problems::default();
        let mut columns = Self { species: usize::MAX, positions: Vec::new(), numbers: Vec::new() };
        for (position, name) in names.iter().enumerate() {
            let repeated = if name == "species" {
                let repeated = columns.species != usize::MAX;
                columns.species = position;
                repeated
            } else if let Some(column) = parse(name) {
                let repeated = columns.index(column.quantity, column.axis).is_some();
                columns.positions.push(position);
                columns.numbers.push(column);
                repeated
            } else {
                problems.add(unknown(name));
                false
            };
            if repeated {
                problems.add(format!("column {name}: its quantity has two columns; remove one"));
            }
        }
        columns.find_missing(&mut problems);
        problems.into_result(columns)
    }

    fn find_missing(&self, problems: &mut Problems) {
        if self.species == usize::MAX {
            problems.add("column species is missing; add it with the name of each particle's species".into());
        }
        for (field, quantity, axis) in FIELDS {
            let needed = match quantity {
                Quantity::Position => true,
                Quantity::Radius => !self.has(Quantity::SemiAxis),
                Quantity::Orientation => self.has(Quantity::SemiAxis) || self.has(quantity),
                // All components or none.
                Quantity::SemiAxis | Quantity::Velocity | Quantity::Spin => self.has(quantity),
            };
            if needed && self.index(quantity, axis).is_none() {
                problems.add(format!("column {} is missing; add it", name(field, units(quantity)[0].0)));
            }
        }
        if self.has(Quantity::Radius) && self.has(Quantity::SemiAxis) {
            problems.add("radius and semi-axes are both given; remove one of the two".into());
        }
    }

    fn has(&self, quantity: Quantity) -> bool {
        self.numbers.iter().any(|column| column.quantity == quantity)
    }

    /// Index into `numbers` of a quantity's component.
    pub fn index(&self, quantity: Quantity, axis: usize) -> Option<usize> {
        self.numbers.iter().position(|column| column.quantity == quantity && column.axis == axis)
    }
}

/// Units that a quantity may have, and how many of them make the SI unit; the SI unit first.
fn units(quantity: Quantity) -> &'static [(&'static str, f64)] {
    match quantity {
        Quantity::Position | Quantity::Radius | Quantity::SemiAxis => {
            &[("m", 1.0), ("mm", 1e3), ("um", 1e6), ("nm", 1e9)]
        }
        Quantity::Velocity => &[("m_per_s", 1.0), ("mm_per_s", 1e3), ("um_per_s", 1e6), ("nm_per_s", 1e9)],
        Quantity::Spin => &[("rad_per_s", 1.0)],
        Quantity::Orientation => &[("", 1.0)],
    }
}

/// `field_unit`, or the field alone where there is no unit.
fn name(field: &str, unit: &str) -> String {
    if unit.is_empty() { field.to_owned() } else { format!("{field}_{unit}") }
}

fn parse(name: &str) -> Option<Column> {
    let (field, unit) = name.split_once('_').unwrap_or((name, ""));
    let (_, quantity, axis) = FIELDS.into_iter().find(|(known, ..)| *known == field)?;
    let (_, divisor) = units(quantity).iter().find(|(known, _)| *known == unit)?;
    Some(Column { name: name.to_owned(), quantity, axis, divisor: *divisor })
}

/// The message for an unknown name, with the nearest known one.
fn unknown(name: &str) -> String {
    let known = FIELDS
        .into_iter()
        .flat_map(|(field, quantity, _)| units(quantity).iter().map(move |(unit, _)| self::name(field, unit)));
    let nearest = known
        .chain(["species".to_owned()])
        .map(|known| (strsim::damerau_levenshtein(&known, name), known))
        .min()
        .map(|(_, known)| known)
        .unwrap_or_default();
    format!(
        "column \"{name}\" is not known, the nearest is {nearest}; allowed: species, x_m, y_m, z_m, radius_m or a_m, b_m, \
         c_m with qw, qx, qy, qz, vx_m_per_s to vz_m_per_s, wx_rad_per_s to wz_rad_per_s (lengths and velocities also with mm, um, nm)"
    )
}
