//! A few spheres as a small run in this process: input text and particle table in, simulation out.

use crate::config::Config;
use crate::error::{Error, Result};
use crate::exchange::Communicator;
use crate::force::observe::Wanted;
use crate::setup;
use crate::simulation::{Report, Requests, Simulation};
use crate::state::shape::bounding_radius;
use crate::state::{GlobalState, ParticleState};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// A sphere of the species `sphere`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sphere {
    /// Centre \[m\].
    pub position: [f64; 3],
    /// Radius \[m\].
    pub radius: f64,
    /// Initial velocity \[m/s\].
    pub velocity: [f64; 3],
    /// Initial angular velocity \[rad/s\].
    pub spin: [f64; 3],
    /// Semi-axes \[m\] and orientation of an ellipsoid; its radius is the largest semi-axis.
    pub ellipsoid: Option<([f64; 3], [f64; 4])>,
}

impl Sphere {
    /// An ellipsoid in its place.
    #[must_use]
    pub fn with_semi_axes(self, semi_axes: [f64; 3], orientation: [f64; 4]) -> Self {
        Self { radius: bounding_radius(semi_axes), ellipsoid: Some((semi_axes, orientation)), ..self }
    }
}

/// What happens to spheres of one material (by the name `material`).
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Sides of the cell \[m\].
    pub sides: [f64; 3],
    /// Plane walls at both faces of the z axis, of the material `wall`.
    pub wall: Option<String>,
    /// Keys of the material.
    pub material: String,
    /// The other sections: contact laws, stages, time step.
    pub sections: String,
    /// The spheres; ids in this order.
    pub spheres: Vec<Sphere>,
}

impl Scene {
    fn input(&self) -> String {
        let [x, y, z] = self.sides;
        let (boundary, walls) = match &self.wall {
            Some(material) => (
                "boundary = { z = \"walls\" }\nwall_material = { z = \"wall\" }",
                format!("[[material]]\nname = \"wall\"\n{material}\n"),
            ),
            None => ("", String::new()),
        };
        format!(
            "[cell]\nsides = {{ x = {x:e}, y = {y:e}, z = {z:e} }}\n{boundary}\n\
             [[material]]\nname = \"material\"\n{}\n{walls}\
             [[species]]\nname = \"sphere\"\nmaterial = \"material\"\nradius = {:e}\n\
             [packing.file]\npath = \"particles.csv\"\n{}\n",
            self.material, self.spheres[0].radius, self.sections
        )
    }

    fn table(&self) -> String {
        let header = "species,x_m,y_m,z_m,radius_m,vx_m_per_s,vy_m_per_s,vz_m_per_s,wx_rad_per_s,wy_rad_per_s,\
                      wz_rad_per_s\n";
        self.spheres.iter().fold(header.to_owned(), |mut text, sphere| {
            let ([x, y, z], [vx, vy, vz], [wx, wy, wz]) = (sphere.position, sphere.velocity, sphere.spin);
            let _ = writeln!(
                text,
                "sphere,{x:e},{y:e},{z:e},{:e},{vx:e},{vy:e},{vz:e},{wx:e},{wy:e},{wz:e}",
                sphere.radius
            );
            text
        })
    }

    /// The simulation at its first step.
    ///
    /// # Errors
    /// The input is refused, or no file can be written to the folder for temporary files.
    pub fn start(&self) -> Result<Simulation> {
        let folder = Folder::new()?;
        let table = folder.path.join("particles.csv");
        std::fs::write(&table, self.table()).map_err(|error| unwritable(&table, &error))?;
        let input = folder.path.join("case.toml");
        let config = Arc::new(Config::parse(&self.input(), &input, &[], Some(&folder.path), Some(1))?);
        let comm = Communicator::single();
        let mut initial = setup::from_packing(&comm, &config)?;
        for particle in &mut initial.particles {
            if let Some((semi_axes, orientation)) = self.spheres[particle.id as usize].ellipsoid {
                particle.semi_axes = semi_axes;
                particle.orientation = orientation;
            }
        }
        let decomposition = setup::decomposition(&comm, &config, &initial.global)?;
        setup::simulation(comm, &config, decomposition, initial, 1)
    }

    /// Run to the end and return the spheres as they are then, in the order of the scene.
    ///
    /// # Errors
    /// As [`Scene::start`] and [`Simulation::step`].
    pub fn run(&self) -> Result<Vec<ParticleState>> {
        let mut simulation = self.start()?;
        drive(&mut simulation, |_| Wanted::default(), |_, _| Ok(()))?;
        states(&mut simulation)
    }
}

/// Step to the end of the last stage. `wanted` says what to observe of a state, `each` sees it; the
/// final state is observed as well, if wanted.
///
/// # Errors
/// As [`Simulation::step`], and whatever `each` returns.
pub fn drive(
    simulation: &mut Simulation,
    mut wanted: impl FnMut(&GlobalState) -> Wanted,
    mut each: impl FnMut(&mut Simulation, &Report) -> Result<()>,
) -> Result<()> {
    while !simulation.settle_stage() {
        let wanted = wanted(simulation.global());
        simulation.step(wanted, Requests::default(), &mut each)?;
    }
    let wanted = wanted(simulation.global());
    if wanted.sums || wanted.samples {
        let report = simulation.observe(wanted)?;
        each(simulation, &report)?;
    }
    Ok(())
}

/// States of all spheres by id.
///
/// # Errors
/// The halo exchange failed.
pub fn states(simulation: &mut Simulation) -> Result<Vec<ParticleState>> {
    let (mut particles, _) = simulation.export()?;
    particles.sort_unstable_by_key(|particle| particle.id);
    Ok(particles)
}

/// A folder for the files of one scene, removed when dropped.
struct Folder {
    path: PathBuf,
}

impl Folder {
    fn new() -> Result<Self> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("dem-mpi-verify-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).map_err(|error| unwritable(&path, &error))?;
        Ok(Self { path })
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left of a temporary folder must not hide the result.
        let _ = std::fs::remove_dir_all(&self.path);
    }
}

fn unwritable(path: &std::path::Path, error: &std::io::Error) -> Error {
    Error::File {
        path: path.to_owned(),
        message: format!("cannot be written ({error}); point TMPDIR to a folder that can be"),
    }
}
