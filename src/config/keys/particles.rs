//! Keys of materials and species.

use super::{COEFFICIENT, ZERO, axes, number};
use crate::config::schema::{Default, Kind, Range, Table, key};
use crate::units::Dimension;

use Default::{Absent, Derived, Required};

const RATIO: Kind = Kind::Numbers(Dimension::NONE, Range::POSITIVE);
const LENGTH: Kind = number(Dimension::LENGTH, Range::POSITIVE);

/// `[[material]]`.
pub static MATERIAL: Table = Table {
    meaning: "A material.",
    keys: &[
        key("name", Kind::Text, Required, "Name that species, walls and pairs refer to."),
        key("density", number(Dimension::DENSITY, Range::POSITIVE), Required, "Physical density."),
        key(
            "density_scaling",
            number(Dimension::NONE, Range::POSITIVE),
            Default::Number(1.0),
            "Factor on the density, so on masses and weights: larger time steps, more inertia (see the pre-run sheet).",
        ),
        key(
            "young_modulus",
            number(Dimension::PRESSURE, Range::POSITIVE),
            Required,
            "Young's modulus; with Maxwell branches the long-term one.",
        ),
        key("poisson_ratio", number(Dimension::NONE, Range::between(-1.0, 0.5)), Required, "Poisson's ratio."),
        key("maxwell", Kind::List(&MAXWELL), Absent, "Maxwell branches, parallel to the long-term spring."),
        key("yield_stress", number(Dimension::PRESSURE, Range::POSITIVE), Absent, "Yield stress."),
        key("friction", COEFFICIENT, ZERO, "Coulomb friction coefficient; needs a tangential law."),
        key(
            "restitution",
            number(Dimension::NONE, Range::FRACTION),
            Default::Number(1.0),
            "Coefficient of restitution; 1: no dashpot.",
        ),
        key("rolling_friction", COEFFICIENT, ZERO, "Rolling friction coefficient; needs a rolling law."),
        key("twisting_friction", COEFFICIENT, ZERO, "Twisting friction coefficient; needs a rolling law."),
        key(
            "surface_energy",
            number(Dimension::SURFACE_ENERGY, Range::NOT_NEGATIVE),
            ZERO,
            "Work of adhesion between two surfaces; read by adhesive normal laws.",
        ),
    ],
};

/// `[[material.maxwell]]`.
pub static MAXWELL: Table = Table {
    meaning: "A spring and a dashpot in series. Give `relaxation_time` or `viscosity`.",
    keys: &[
        key("modulus", number(Dimension::PRESSURE, Range::POSITIVE), Required, "Modulus of the spring."),
        key(
            "relaxation_time",
            number(Dimension::TIME, Range::POSITIVE),
            Absent,
            "Time in which the branch relaxes to 1/e.",
        ),
        key(
            "viscosity",
            number(Dimension::VISCOSITY, Range::POSITIVE),
            Absent,
            "Viscosity of the dashpot; relaxation time = viscosity / modulus.",
        ),
    ],
};

/// `[[species]]`.
pub static SPECIES: Table = Table {
    meaning: "A kind of particle. With random close packing give `count`, or `fraction` and the top-level `particles`.",
    keys: &[
        key("name", Kind::Text, Required, "Name, as in a particle file."),
        key("material", Kind::Text, Required, "Name of its material."),
        key(
            "radius",
            Kind::OneOf(&RADIUS, Some("fixed")),
            Absent,
            "Radius or distribution of radii; of ellipsoids the radius of the sphere of equal volume. Needed without \
             `semi_axes`.",
        ),
        key(
            "semi_axes",
            Kind::Axes { dimension: Dimension::LENGTH, range: Range::POSITIVE, uniform: false },
            Absent,
            "Semi-axes of ellipsoids that are all alike, instead of `radius`. Orientations are random.",
        ),
        key("aspect_ratios", Kind::Table(&ASPECT_RATIOS), Absent, "Makes the particles ellipsoids."),
        key("count", Kind::Integer(1), Absent, "Number of particles."),
        key("fraction", number(Dimension::NONE, Range::FRACTION), Absent, "Share of all particles, by number."),
        key("motion", Kind::OneOf(&MOTION, None), Default::Word("free"), "What moves it."),
        key("velocity", axes(Dimension::VELOCITY, false), ZERO, "Initial velocity."),
        key(
            "velocity_deviation",
            number(Dimension::VELOCITY, Range::NOT_NEGATIVE),
            ZERO,
            "Standard deviation of a random normal part of each velocity component.",
        ),
        key("spin", axes(Dimension::RATE, false), ZERO, "Initial angular velocity; in rad/s, 1/s or rpm."),
    ],
};

/// `[species.aspect_ratios]`.
static ASPECT_RATIOS: Table = Table {
    meaning: "Ratios of the semi-axes a, b, c of ellipsoids with the volume of a sphere of the given radius; drawn per \
              particle. Orientations are random.",
    keys: &[
        key("b_to_a", RATIO, Required, "b/a: [one ratio], or [smallest, largest] of a uniform distribution."),
        key("c_to_a", RATIO, Required, "c/a, likewise."),
    ],
};

/// `[species.radius]`.
pub static RADIUS: Table = Table {
    meaning: "Distribution of radii, by number. A plain value is the fixed radius.",
    keys: &[
        key("fixed", LENGTH, Absent, "All equal."),
        key("normal", Kind::Table(&NORMAL), Absent, "Normal distribution, cut."),
        key("lognormal", Kind::Table(&LOGNORMAL), Absent, "Lognormal distribution, cut."),
        key("tabulated", Kind::Table(&TABULATED), Absent, "Some radii with weights."),
    ],
};

static NORMAL: Table = Table {
    meaning: "Normal distribution of radii.",
    keys: &[
        key("mean", LENGTH, Required, "Mean before the cut."),
        key("deviation", LENGTH, Required, "Standard deviation before the cut."),
        key("min", LENGTH, Derived("mean - 3 deviation"), "Smallest radius."),
        key("max", LENGTH, Derived("mean + 3 deviation"), "Largest radius."),
    ],
};

static LOGNORMAL: Table = Table {
    meaning: "Lognormal distribution of radii.",
    keys: &[
        key("median", LENGTH, Required, "Median before the cut."),
        key("sigma", number(Dimension::NONE, Range::POSITIVE), Required, "Standard deviation of ln R."),
        key("min", LENGTH, Derived("median · exp(-3 sigma)"), "Smallest radius."),
        key("max", LENGTH, Derived("median · exp(3 sigma)"), "Largest radius."),
    ],
};

static TABULATED: Table = Table {
    meaning: "Radii with weights, two lists of one length.",
    keys: &[
        key("radius", Kind::Numbers(Dimension::LENGTH, Range::POSITIVE), Required, "Radii."),
        key(
            "weight",
            Kind::Numbers(Dimension::NONE, Range::NOT_NEGATIVE),
            Required,
            "Weights by number, any sum above 0.",
        ),
    ],
};

static NOTHING: Table = Table { meaning: "Has no keys.", keys: &[] };

/// `[species.motion]`.
pub static MOTION: Table = Table {
    meaning: "What moves the particles of a species.",
    keys: &[
        key("free", Kind::Table(&NOTHING), Absent, "Forces."),
        key("fixed", Kind::Table(&NOTHING), Absent, "Nothing; it stays where it is."),
        key("driven", Kind::Table(&DRIVEN), Absent, "A prescribed motion, whatever the forces."),
    ],
};

static DRIVEN: Table = Table {
    meaning: "Prescribed motion.",
    keys: &[
        key("velocity", axes(Dimension::VELOCITY, false), ZERO, "Velocity."),
        key("spin", axes(Dimension::RATE, false), ZERO, "Angular velocity; in rad/s, 1/s or rpm."),
    ],
};
