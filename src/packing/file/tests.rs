use super::*;
use ::hdf5::types::{FixedAscii, VarLenUnicode};
use std::path::PathBuf;

const CELL: Region = Region { sides: Some([1.0; 3]), periodic: [true, true, false] };

fn write(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("particles.csv");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn read_text(text: &str) -> Result<Vec<Row>> {
    let (_folder, path) = write(text);
    read(&path, &["active", "binder"], &CELL).map(|contents| contents.rows)
}

fn assert_refused(text: &str, expected: &[&str]) {
    let message = read_text(text).unwrap_err().to_string();
    for part in expected.iter().chain(&["particles.csv"]) {
        assert!(message.contains(part), "\"{part}\" is not in: {message}");
    }
}

#[test]
fn a_table_gives_particles_in_the_order_of_its_rows() {
    let rows =
        read_text("species, x_m, y_m, z_m, radius_m\nbinder, 0.1, 0.2, 0.3, 0.05\n# note\nactive,1e-1,0,0.5,.25\n");
    let rows = rows.unwrap();
    let expected = Row {
        species: 1,
        position: [0.1, 0.2, 0.3],
        radius: 0.05,
        semi_axes: None,
        orientation: None,
        density: None,
        velocity: None,
        spin: None,
    };
    assert_eq!(rows[0], expected);
    assert_eq!((rows[1].species, rows[1].position, rows[1].radius), (0, [0.1, 0.0, 0.5], 0.25));
}

#[test]
fn a_file_without_particles_is_refused_as_such() {
    assert_refused("species,x_m,y_m,z_m,radius_m\n# none\n", &["the file holds no particles"]);
}

#[test]
fn units_and_motion_are_understood_in_any_order_of_columns() {
    let rows = read_text(
        "radius_um,wz_rad_per_s,wy_rad_per_s,wx_rad_per_s,z_mm,y_nm,x_m,species,vx_m_per_s,vy_mm_per_s,vz_um_per_s\n\
         0.25,3,2,1,0.5,7,0.5,active,1,2,3\n",
    );
    let row = &rows.unwrap()[0];
    assert_eq!((row.position, row.radius), ([0.5, 7e-9, 0.5e-3], 0.25e-6));
    assert_eq!((row.velocity, row.spin), (Some([1.0, 2e-3, 3e-6]), Some([1.0, 2.0, 3.0])));
}

#[test]
fn ellipsoids_have_semi_axes_and_an_orientation_instead_of_a_radius() {
    let header = "species,x_m,y_m,z_m,a_um,b_um,c_um,qw,qx,qy,qz\n";
    let rows = read_text(&format!("{header}active,0,0,0.5,2,5,3,0.8,0,-0.6,0\n")).unwrap();
    assert_eq!((rows[0].semi_axes, rows[0].radius), (Some([2e-6, 5e-6, 3e-6]), 5e-6));
    assert_eq!(rows[0].orientation, Some([0.8, 0.0, -0.6, 0.0]));
    let bad = |text: &str| format!("{header}active,0,0,0.5,{text}\n");
    assert_refused(&bad("2,0,3,1,0,0,0"), &["line 2", "column b_um", "is not a semi-axis"]);
    assert_refused(&bad("2,5,3,1,1,0,0"), &["line 2", "qw to qz", "length 1.4142", "normalise"]);
    assert_refused("species,x_m,y_m,z_m,a_m,b_m,c_m\nactive,0,0,0,1,1,1\n", &["column qw is missing"]);
    let both = "species,x_m,y_m,z_m,radius_m,a_m,b_m,c_m,qw,qx,qy,qz\n";
    assert_refused(both, &["radius and semi-axes are both given"]);
}

#[test]
fn positions_beyond_periodic_faces_are_wrapped() {
    let rows = read_text("species,x_m,y_m,z_m,radius_m\nactive,-1e-20,1.25,1.0,0.1\n").unwrap();
    assert_eq!(rows[0].position, [0.0, 0.25, 1.0]);
}

#[test]
fn bad_tables_are_refused_with_line_column_value_and_remedy() {
    let header = "species,x_m,y_m,z_m,radius_m\n";
    let row = |text: &str| format!("{header}active,0,0,0,0.1\n{text}\n");
    assert_refused(&row("active,0,zero,0,0.1"), &["line 3", "column y_m", "\"zero\"", "write it like"]);
    assert_refused(&row("active,0,0,0,-0.1"), &["line 3", "column radius_m", "-0.1", "greater than 0"]);
    assert_refused(&row("active,0,NaN,0,0.1"), &["line 3", "column y_m", "NaN", "finite"]);
    assert_refused(&row("active,0,0,1.5,0.1"), &["line 3", "column z_m", "1.5", "walls", "enlarge"]);
    assert_refused(&row("carbon,0,0,0,0.1"), &["line 3", "\"carbon\"", "active, binder"]);
    assert_refused(&row("active,0,0,0"), &["line: 3", "as many fields"]);
    assert_refused("species,x_m,y_m,radius_m\n", &["z_m is missing"]);
    assert_refused("x_m,y_m,z_m,radius_m\n", &["species is missing"]);
    assert_refused("species,x_m,y_m,z_m,raduis_m\n", &["\"raduis_m\"", "nearest is radius_m"]);
    assert_refused("species,x_m,x_um,y_m,z_m,radius_m\n", &["column x_um", "two columns"]);
    assert_refused("species,x_m,y_m,z_m,radius_m,vx_m_per_s,vz_m_per_s\n", &["vy_m_per_s is missing"]);
}

#[test]
fn many_problems_are_told_at_once_and_counted() {
    let text = format!("species,x_m,y_m,z_m,radius_m\n{}", "carbon,0,0,0,0\n".repeat(20));
    assert_refused(&text, &["line 2, column species", "line 6, column radius_m", "and 30 more"]);
}

#[test]
fn missing_and_foreign_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["absent.csv", "absent.h5"] {
        let message = read(&folder.path().join(name), &[], &CELL).unwrap_err().to_string();
        assert!(message.contains(name) && message.contains("correct the path"), "{message}");
    }
    let text = folder.path().join("text.h5");
    std::fs::write(&text, "no HDF5").unwrap();
    let message = read(&text, &[], &CELL).unwrap_err().to_string();
    assert!(message.contains("not a readable HDF5 file"), "{message}");
    let message = read(&folder.path().join("particles.txt"), &[], &CELL).unwrap_err().to_string();
    assert!(message.contains(".csv, .h5 and .hdf5 files and from LAMMPS"), "{message}");
}

fn write_hdf5(path: &Path, radii: &[f32]) -> ::hdf5::File {
    let file = ::hdf5::File::create(path).unwrap();
    for name in ["x_m", "y_m", "z_m"] {
        file.new_dataset_builder().with_data(&[0.25, 0.5]).create(name).unwrap();
    }
    file.new_dataset_builder().with_data(radii).create("radius_um").unwrap();
    file
}

#[test]
fn hdf5_tables_read_like_csv_whatever_kind_of_string() {
    let folder = tempfile::tempdir().unwrap();
    for fixed in [false, true] {
        let path = folder.path().join(format!("{fixed}.h5"));
        let file = write_hdf5(&path, &[0.5, 0.25]);
        if fixed {
            let names = ["binder", "active"].map(|name| FixedAscii::<7>::from_ascii(name).unwrap());
            file.new_dataset_builder().with_data(&names).create("species").unwrap();
        } else {
            let names = ["binder", "active"].map(|name| name.parse::<VarLenUnicode>().unwrap());
            file.new_dataset_builder().with_data(&names).create("species").unwrap();
        }
        drop(file);
        let rows = read(&path, &["active", "binder"], &CELL).unwrap().rows;
        assert_eq!((rows[0].species, rows[1].species), (1, 0));
        assert_eq!((rows[1].position, rows[1].radius), ([0.5; 3], 0.25e-6));
    }
}

#[test]
fn hdf5_tables_are_checked_like_csv() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, radii: &[f32], numbers_as_names: bool| {
        let path = folder.path().join(name);
        let file = write_hdf5(&path, radii);
        if numbers_as_names {
            file.new_dataset_builder().with_data(&[1, 2]).create("species").unwrap();
        } else {
            let names = ["binder", "active"].map(|name| name.parse::<VarLenUnicode>().unwrap());
            file.new_dataset_builder().with_data(&names).create("species").unwrap();
        }
        drop(file);
        read(&path, &["active", "binder"], &CELL).unwrap_err().to_string()
    };
    let message = refused("negative.h5", &[0.5, -0.25], false);
    assert!(message.contains("row 1, column radius_um: -0.25"), "{message}");
    let message = refused("short.h5", &[0.5], false);
    assert!(message.contains("radius_um has 1 values, species has 2"), "{message}");
    let message = refused("numbers.h5", &[0.5, 0.5], true);
    assert!(message.contains("dataset species is not a list of names"), "{message}");
}
