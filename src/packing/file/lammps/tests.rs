use crate::packing::file::{Contents, Region, read, species_names};

const FREE: Region = Region { sides: None, periodic: [true; 3] };

const GOOD: &str = "LAMMPS data file

3 atoms
2 atom types   # a comment
0 bonds

-1.0 1.0 xlo xhi
0 4e0 ylo yhi
1 6 zlo zhi
0 0 0 xy xz yz

Atoms  # sphere

3 1 0.5 1800 0.25 0.5 1.5
1 2 0.25 2500 -1.25 4.5 6
2 1 1 1800 0 0 3 1 -1 0

Velocities

2 1 2 3 4 5 6
1 0 0 0 0 0 0
3 -1 0 0 0 0 1e-3
";

fn read_as(name: &str, text: &str, region: &Region) -> Result<Contents, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    read(&path, &["small", "large"], region).map_err(|error| error.to_string())
}

fn assert_refused(text: &str, expected: &[&str]) {
    let message = read_as("box.data", text, &FREE).unwrap_err();
    for part in expected.iter().chain(&["box.data"]) {
        assert!(message.contains(part), "\"{part}\" is not in: {message}");
    }
}

#[test]
fn atoms_in_any_order_become_particles_by_id_in_a_cell_that_begins_at_zero() {
    let contents = read_as("box.data", GOOD, &FREE).unwrap();
    assert_eq!(contents.sides, [2.0, 4.0, 5.0]);
    let rows = contents.rows;
    // Atom 1 lies beyond three faces of the box.
    assert_eq!(rows[0].position, [1.75, 0.5, 0.0]);
    assert_eq!(rows[1].position, [1.0, 0.0, 2.0]);
    assert_eq!(rows[2].position, [1.25, 0.5, 0.5]);
    assert_eq!(rows.iter().map(|row| row.radius).collect::<Vec<_>>(), [0.125, 0.5, 0.25]);
    assert_eq!(rows.iter().map(|row| row.species).collect::<Vec<_>>(), [1, 0, 0]);
    assert_eq!(rows.iter().map(|row| row.density).collect::<Vec<_>>(), [Some(2500.0), Some(1800.0), Some(1800.0)]);
    assert_eq!((rows[1].velocity, rows[1].spin), (Some([1.0, 2.0, 3.0]), Some([4.0, 5.0, 6.0])));
    assert_eq!(rows[2].spin, Some([0.0, 0.0, 1e-3]));
}

#[test]
fn data_files_are_known_by_name_or_text() {
    for name in ["a.data", "a.LMP", "data.packing", "packing"] {
        assert!(read_as(name, GOOD, &FREE).is_ok(), "{name}");
    }
    let message = read_as("packing", &GOOD.replace("3 atoms", "three atoms"), &FREE).unwrap_err();
    assert!(message.contains("LAMMPS data files (.data, .lmp)"), "{message}");
}

#[test]
fn a_title_that_looks_like_a_header_line_is_still_a_title() {
    let contents = read_as("a.data", &GOOD.replace("LAMMPS data file", "99 atoms"), &FREE).unwrap();
    assert_eq!(contents.rows.len(), 3);
}

#[test]
fn granular_is_the_same_style_and_windows_line_ends_do_no_harm() {
    let text = GOOD.replace("# sphere", "# granular").replace('\n', "\r\n");
    assert_eq!(read_as("a.data", &text, &FREE), read_as("a.data", GOOD, &FREE));
}

#[test]
fn types_are_the_species_that_a_caller_without_input_takes() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("a.data");
    std::fs::write(&data, GOOD).unwrap();
    assert_eq!(species_names(&data).unwrap(), ["1", "2"]);
    let table = folder.path().join("a.csv");
    std::fs::write(&table, "species,x_m,y_m,z_m,radius_m\nb,0,0,0,1\na,0,0,0,1\nb,0,0,0,1\n").unwrap();
    assert_eq!(species_names(&table).unwrap(), ["b", "a"]);
}

#[test]
fn sides_of_the_input_must_be_those_of_the_box() {
    let given = |sides| Region { sides: Some(sides), ..FREE };
    assert!(read_as("a.data", GOOD, &given([2.0, 4.0, 5.0])).is_ok());
    let message = read_as("a.data", GOOD, &given([2.0, 4.0, 5.5])).unwrap_err();
    assert!(message.contains("the box is 5e0 m wide in z") && message.contains("remove `sides`"), "{message}");
}

#[test]
fn atoms_beyond_walls_are_refused() {
    let walls = Region { sides: None, periodic: [true, false, true] };
    let message = read_as("a.data", GOOD, &walls).unwrap_err();
    assert!(message.contains("line 15: y = 4.5 lies outside the walls"), "{message}");
}

#[test]
fn bad_headers_are_refused_with_line_and_remedy() {
    let with = |from: &str, to: &str| GOOD.replace(from, to);
    assert_refused(&with("3 atoms", "3.5 atoms"), &["line 3", "\"3.5\"", "number of atoms"]);
    assert_refused(&with("0 bonds", "2 bonds"), &["line 5", "2 bonds", "atom_style sphere"]);
    assert_refused(&with("0 0 0 xy", "0 0.1 0 xy"), &["line 10", "tilts the box", "change_box all ortho"]);
    assert_refused(&with("0 0 0 xy xz yz", "1 0 0 avec"), &["line 10", "tilts the box"]);
    assert_refused(&with("0 4e0 ylo yhi\n", "\n"), &["LOW HIGH ylo yhi", "add it"]);
    assert_refused(&with("0 4e0 ylo", "4 4 ylo"), &["from 4 to 4 in y", "must exceed"]);
    assert_refused(&with("-1.0 1.0 xlo", "-1,0 1.0 xlo"), &["line 7", "\"-1,0\"", "coordinate"]);
    assert_refused(&with("3 atoms\n", "\n"), &["N atoms"]);
    assert_refused(&with("2 atom types   # a comment\n", "\n"), &["N atom types"]);
}

#[test]
fn bad_atoms_are_refused_with_line_and_remedy() {
    let with = |from: &str, to: &str| GOOD.replace(from, to);
    assert_refused(&with("# sphere", "# atomic"), &["line 12", "style atomic", "only atom_style sphere"]);
    assert_refused(&with("3 1 0.5 1800 0.25 0.5 1.5", "3 1 0.25 0.5 1.5"), &["line 14", "5 columns"]);
    assert_refused(&with("3 1 0.5 1800", "4 1 0.5 1800"), &["line 14", "\"4\" is none from 1 to 3", "reset_atoms id"]);
    assert_refused(&with("3 1 0.5 1800", "2 1 0.5 1800"), &["line 16", "atom 2 stands there twice"]);
    assert_refused(&with("3 1 0.5 1800", "3 0 0.5 1800"), &["line 14", "type \"0\" is none from 1 to 2"]);
    assert_refused(&with("3 1 0.5 1800", "3 1 0 1800"), &["line 14", "diameter 0", "greater than 0"]);
    assert_refused(&with("3 1 0.5 1800", "3 1 0.5 -1"), &["line 14", "density -1", "greater than 0"]);
    assert_refused(&with("0.25 0.5 1.5", "0.25 nan 1.5"), &["line 14", "y \"nan\"", "finite"]);
    assert_refused(&with("0.25 0.5 1.5", "0.25 0,5 1.5"), &["line 14", "y \"0,5\"", "1.5e-6"]);
    let three = with("2 atom types", "3 atom types").replace("3 1 0.5 1800", "3 3 0.5 1800");
    assert_refused(&three, &["line 14", "type 3 has no species, the input has 2", "[[species]]"]);
    assert_refused(&with("1 0 0 0 0 0 0\n", "1 0 0 0\n"), &["line 21", "4 columns", "id vx vy vz"]);
    assert_refused(&with("3 -1 0 0", "1 -1 0 0"), &["line 22", "atom 1 has its velocities twice"]);
}

#[test]
fn incomplete_files_and_foreign_sections_are_refused() {
    let (before, _) = GOOD.split_once("2 1 1 1800").unwrap();
    assert_refused(before, &["section Atoms ends after 2 of 3", "write it again"]);
    let (before, _) = GOOD.split_once("Atoms").unwrap();
    assert_refused(before, &["no section Atoms"]);
    let (_, velocities) = GOOD.split_once("Velocities").unwrap();
    assert_refused(&format!("{before}Velocities{velocities}"), &["line 12", "before Atoms"]);
    assert_refused(&GOOD.replace("Velocities", "Bonds"), &["line 18", "\"Bonds\"", "remove it"]);
    assert_refused(&GOOD.replace("Velocities", "Atoms"), &["line 18", "second section Atoms"]);
    assert_refused(
        &GOOD.replace("3 atoms", "2 atoms"),
        &["line 14", "\"3\" is none from 1 to 2", "line 16", "more lines"],
    );
    let message = read(std::path::Path::new("absent.data"), &[], &FREE).unwrap_err().to_string();
    assert!(message.contains("absent.data") && message.contains("correct the path"), "{message}");
}

#[test]
fn many_problems_are_told_at_once() {
    let text = GOOD.replace("1800", "0");
    assert_refused(&text, &["line 14: density 0", "line 16: density 0"]);
}

#[test]
fn a_section_before_the_atoms_is_named_and_not_said_to_be_their_lack() {
    let text = GOOD.replace("Atoms  # sphere", "Masses\n\n1 1800\n\nAtoms  # sphere");
    assert_refused(&text, &["\"Masses\" begins no section", "line 12"]);
}
