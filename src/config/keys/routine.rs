//! Keys of the quasi-static routine.

use super::{Absent, Default, Key, Kind, Range, Table, key, number};
use crate::units::Dimension;

/// `[load.quasi_static]`.
pub static QUASI_STATIC: Table = Table {
    meaning: "The quasi-static routine: after each strain increment blocks of substeps with artificial damping, until \
              force, kinetic energy and displacement are below their thresholds. See docs/quasi_static.md.",
    keys: &[
        key(
            "substeps",
            Kind::Integer(2),
            Default::Integer(50),
            "Substeps per block; equilibrium is tested after each.",
        ),
        key(
            "max_blocks",
            Kind::Integer(1),
            Default::Integer(2000),
            "Blocks that one increment may take; without equilibrium after them the run stops with an error.",
        ),
        key(
            "damping",
            Kind::OneOf(&DAMPING, None),
            Default::Word("fire"),
            "What removes the kinetic energy, beside the dashpots of the contact laws.",
        ),
        key(
            "restitution",
            number(Dimension::NONE, Range::FRACTION),
            Default::Number(0.5),
            "What the dashpots of the contact laws take for the restitution coefficient in quasi-static stages, where \
             they are artificial damping; the material's own has no effect there.",
        ),
        key(
            "safety",
            number(Dimension::NONE, Range::closed(0.01, 0.6)),
            Default::Number(0.3),
            "The pseudo time step is safety · √(smallest mass / largest contact stiffness); strong dashpots (restitution) \
             lower the factor, as packings would vibrate otherwise.",
        ),
        threshold("max_unbalanced_ratio", 1e-3, "Mean unbalanced force over mean contact force at equilibrium."),
        threshold("max_kinetic_ratio", 1e-6, "Kinetic over elastic energy at equilibrium."),
        threshold(
            "max_displacement_ratio",
            1e-4,
            "Way of the fastest particle in one more block, over the largest radius, at equilibrium.",
        ),
        key(
            "touching_overlap",
            number(Dimension::NONE, Range::between(0.0, 0.1)),
            Default::Number(5e-4),
            "Overlap over radius whose mean force and energy are the least that ratios refer to: where all contacts are \
             weaker, particles just touch. With gravity the force is at most the mean weight.",
        ),
    ],
};

const fn threshold(name: &'static str, default: f64, meaning: &'static str) -> Key {
    key(name, number(Dimension::NONE, Range::POSITIVE), Default::Number(default), meaning)
}

static DAMPING: Table = Table {
    meaning: "Artificial damping of the substeps.",
    keys: &[
        key(
            "fire",
            Kind::Table(&FIRE),
            Absent,
            "All velocities turn towards the forces, and stop when they go uphill.",
        ),
        key("local", Kind::Table(&LOCAL), Absent, "Against each velocity a share of the force (Cundall's)."),
        key("viscous", Kind::Table(&VISCOUS), Absent, "Proportional to mass and velocity (dynamic relaxation)."),
        key("contact", Kind::Table(&CONTACT), Absent, "None beside the dashpots of the contact laws (W Sec. 3.1)."),
    ],
};

static FIRE: Table = Table {
    meaning: "Fast inertial relaxation: v ← (1−α) v + α |v| F/|F| while the power F·v is positive, else v = 0.",
    keys: &[key(
        "mixing",
        number(Dimension::NONE, Range::closed(0.0, 1.0)),
        Default::Number(0.05),
        "α after a stop; it shrinks by 1 % per substep from the fifth on. 0: velocities only stop.",
    )],
};

static LOCAL: Table = Table {
    meaning: "Local non-viscous damping: a force −coefficient·|F|·sign(v) on each component.",
    keys: &[key(
        "coefficient",
        number(Dimension::NONE, Range::between(0.0, 1.0)),
        Default::Number(0.7),
        "Share of the unbalanced force.",
    )],
};

static VISCOUS: Table = Table {
    meaning: "Dynamic relaxation: every velocity loses the same share in each substep.",
    keys: &[key(
        "share",
        number(Dimension::NONE, Range::between(0.0, 1.0)),
        Default::Number(0.05),
        "Share of the velocity that a substep takes away.",
    )],
};

static CONTACT: Table = Table { meaning: "Dashpots of the contact laws only.", keys: &[] };
