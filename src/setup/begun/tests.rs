use super::{check, passed_ends};
use crate::output::digest::tests::sample;
use crate::state::{GlobalState, QuasiStaticState};

const INPUT: &str = "seed = 1\n[packing.random_close]\ncontraction_rate = 0.001\n[cell]\nsolid_fraction = 0.6\n\
    [[species]]\nname = \"a\"\ncount = 60\nvelocity = [0.0, 0.0, 0.0]\n[species.radius]\nfixed = 1e-6\n\
    [[stage]]\nstrain_rate = [0.0, 0.0, 1.0]\nduration = 1.0\n[[stage]]\nstrain_rate = [0.0, 0.0, -1.0]\nsteps = 5\n\
    [stage.stress.x]\ntarget = 5.0\nmax_rate = 1.0\n[load]\nkinematics = \"BC\"\n\
    [output]\nhistory = \"10 steps\"\n";

/// In `stage`, `steps` steps after it began.
fn state(stage: usize, steps: u64) -> GlobalState {
    let global = sample(1).0;
    GlobalState { stage, step: global.stage_start_step + steps, ..global }
}

fn refused(from: &str, to: &str, global: &GlobalState) -> Option<String> {
    assert!(INPUT.contains(from));
    check(INPUT, &INPUT.replace(from, to), global).err().map(|error| error.to_string())
}

#[test]
fn what_a_run_begins_with_cannot_change() {
    for (from, to, named) in [
        ("count = 60", "count = 61", "species.0.count is 61 and was 60"),
        ("fixed = 1e-6", "fixed = 2e-6", "species.0.radius.fixed"),
        ("seed = 1", "seed = 2", "seed is 2 and was 1"),
        ("contraction_rate = 0.001", "contraction_rate = 0.002", "packing.random_close.contraction_rate"),
        ("solid_fraction = 0.6", "sides = [1.0, 1.0, 1.0]", "cell.solid_fraction is gone and was 0.6"),
        ("\"BC\"", "\"BCT\"", "load.kinematics"),
    ] {
        let message = refused(from, to, &state(0, 7)).unwrap();
        assert!(message.contains(named), "{message}");
    }
}

#[test]
fn species_keep_their_names_number_and_order() {
    let before = "[[species]]\nname = \"a\"\n[[species]]\nname = \"b\"\n";
    for (now, named) in [
        ("[[species]]\nname = \"b\"\n[[species]]\nname = \"a\"\n", "are \"b\", \"a\" and were \"a\", \"b\""),
        ("[[species]]\nname = \"a\"\n[[species]]\nname = \"c\"\n", "are \"a\", \"c\" and were \"a\", \"b\""),
        ("[[species]]\nname = \"a\"\n", "are \"a\" and were \"a\", \"b\""),
        (&format!("{before}[[species]]\nname = \"c\"\n"), "are \"a\", \"b\", \"c\" and were \"a\", \"b\""),
    ] {
        let message = check(before, now, &state(0, 7)).unwrap_err().to_string();
        assert!(message.contains(named), "{message}");
    }
    let [soft, hard] = ["soft", "hard"].map(|name| before.replace("name", &format!("material = \"{name}\"\nname")));
    assert!(check(&soft, &soft, &state(0, 7)).is_ok());
    let message = check(&soft, &hard, &state(0, 7)).unwrap_err().to_string();
    assert!(message.contains("species.1.material is \"hard\" and was \"soft\""), "{message}");
}

#[test]
fn a_stage_that_has_begun_strains_as_it_did() {
    let faster = ("strain_rate = [0.0, 0.0, 1.0]", "strain_rate = [0.0, 0.0, 4.0]");
    assert!(refused(faster.0, faster.1, &state(0, 7)).unwrap().contains("stage.0.strain_rate"));
    assert!(refused(faster.0, faster.1, &state(1, 0)).unwrap().contains("stage.0.strain_rate"));
    assert_eq!(refused(faster.0, faster.1, &state(0, 0)), None);
    let later = ("strain_rate = [0.0, 0.0, -1.0]", "strain_rate = [0.0, 0.0, -2.0]");
    assert_eq!(refused(later.0, later.1, &state(0, 7)), None);
    assert_eq!(refused(later.0, later.1, &state(1, 0)), None);
    assert!(refused(later.0, later.1, &state(1, 1)).unwrap().contains("stage.1.strain_rate"));
    // Another axis, or none, steered by a stress.
    for (from, to) in [("stage.stress.x", "stage.stress.y"), ("stage.stress.x", "output.some")] {
        assert!(refused(from, to, &state(1, 1)).unwrap().contains("stage.1.stress"));
        assert_eq!(refused(from, to, &state(0, 7)), None);
    }
    assert_eq!(refused("target = 5.0", "target = 6.0", &state(1, 1)), None);
}

#[test]
fn whether_there_was_a_ledger() {
    let with = INPUT.replace("[output]\n", "[output]\nenergy_ledger = true\n");
    assert!(!check(INPUT, &with, &state(0, 7)).unwrap());
    assert!(check(&with, INPUT, &state(0, 7)).unwrap());
}

#[test]
fn ends_of_stages_output_and_keys_of_newer_programs_may_change() {
    for (from, to) in [
        ("duration = 1.0", "duration = 2.0"),
        ("\"10 steps\"", "\"5 steps\""),
        ("count = 60\n", "count = 60\nnovelty = 1\n"),
    ] {
        assert_eq!(refused(from, to, &state(0, 7)), None, "{to}");
    }
}

const CYCLES: &str = "[[stage]]\ncycles = 2\n[[stage.part]]\nstrain_rate = [1.0, 0.0, 0.0]\nsteps = 5\n\
    [[stage.part]]\nstrain_rate = [-1.0, 0.0, 0.0]\nsteps = 6\n[[stage]]\nstrain_rate = [0.0, 0.0, 0.0]\nsteps = 7\n";

#[test]
fn stages_of_cycles_are_counted_as_they_run() {
    let faster = CYCLES.replace("[-1.0", "[-2.0");
    assert!(check(CYCLES, &faster, &state(1, 0)).is_ok());
    let message = check(CYCLES, &faster, &state(3, 2)).unwrap_err().to_string();
    assert_eq!(message.matches("stage.0.part.1.strain_rate is").count(), 1, "{message}");
    assert!(check(CYCLES, &CYCLES.replace("[0.0, 0.0, 0.0]", "[3.0, 0.0, 0.0]"), &state(4, 0)).is_ok());
    assert!(check(CYCLES, &CYCLES.replace("[0.0, 0.0, 0.0]", "[3.0, 0.0, 0.0]"), &state(4, 1)).is_err());
}

#[test]
fn changed_ends_of_stages_that_are_over_are_found() {
    for (from, to, stage, change, last) in [
        ("steps = 7", "steps = 8", 5, "stage.1.steps is 8 and was 7", true),
        ("steps = 7", "duration = 8.0", 5, "stage.1.duration is 8.0 and was not there", true),
        ("steps = 7", "steps = 8", 4, "", false),
        ("steps = 6", "steps = 8", 5, "stage.0.part.1.steps is 8 and was 6", false),
        ("steps = 6", "steps = 8", 1, "", false),
        ("steps = 5", "steps = 8", 1, "stage.0.part.0.steps is 8 and was 5", false),
    ] {
        let found = passed_ends(CYCLES, &CYCLES.replace(from, to), &state(stage, 0)).unwrap();
        assert!(found.changes.is_empty() == change.is_empty(), "{:?}", found.changes);
        assert!(found.changes.join(", ").contains(change), "{:?}", found.changes);
        assert_eq!(found.last_of_complete, last, "{to} in {stage}");
    }
}

#[test]
fn an_increment_that_a_changed_end_has_cut_is_found() {
    let input = "[[stage]]\nstrain_increment = [0.0, 0.0, 2e-4]\n[stage.until_strain]\nz = 0.0041\n";
    let later = input.replace("0.0041", "0.006");
    let within = |strain: f64, substep: u64| {
        let progress =
            QuasiStaticState { increments: 20, stage_start_increments: 0, substep, mixing: 0.0, downhill: 0 };
        GlobalState { strain: [0.0, 0.0, strain], quasi_static: Some(progress), ..state(0, 7) }
    };
    let cut = passed_ends(input, &later, &within(0.0041, 5)).unwrap();
    assert!(cut.too_late && cut.changes.join("").contains("stage.0.until_strain.z is 0.006 and was 0.0041"));
    assert!(!passed_ends(input, input, &within(0.0041, 5)).unwrap().too_late);
    assert!(!passed_ends(input, &later, &within(0.004, 5)).unwrap().too_late);
}

#[test]
fn a_stage_that_has_begun_neither_begins_to_strain_nor_goes() {
    let hold = "[[stage]]\nhold = true\nsteps = 9\n";
    for (now, named) in [
        (
            hold.replace("hold = true", "strain_rate = [0.0, 0.0, 1.0]"),
            "stage.0.strain_rate is [0.0, 0.0, 1.0] and was",
        ),
        (hold.replace("hold = true", "relax = true"), "stage.0 is quasi_static and was dynamic"),
        (String::new(), "stage.0, which has begun, is gone"),
    ] {
        let message = check(hold, &now, &state(0, 7)).unwrap_err().to_string();
        assert!(message.contains(named), "{message}");
        assert!(check(hold, &now, &state(0, 0)).is_ok());
    }
    let relax = "[[stage]]\nrelax = true\n";
    let strained = "[[stage]]\nstrain_increment = [0.0, 0.0, 1e-4]\nincrements = 3\n";
    let message = check(relax, strained, &state(0, 7)).unwrap_err().to_string();
    assert!(message.contains("stage.0.strain_increment"), "{message}");
}

#[test]
fn an_end_that_lies_behind_the_state_is_too_late() {
    // 7 steps of 0.1 s after the stage began, at a stress of 3 Pa.
    let global = GlobalState {
        time: 0.7,
        previous_time: Some(0.6),
        time_step: 0.1,
        previous_time_step: 0.1,
        stage_start_time: 0.0,
        strain: [0.0, 0.0, 0.7],
        stage_start_strain: [0.0; 3],
        stage_start_stress: [0.0; 3],
        measured_stress: [0.0, 0.0, 3.0],
        ..state(0, 7)
    };
    let global = GlobalState { previous_time: Some(global.time - global.time_step), ..global };
    let too_late = |old: &str, new: &str, global: &GlobalState| {
        let input = |end: &str| format!("[[stage]]\nstrain_rate = [0.0, 0.0, 1.0]\n{end}\n");
        passed_ends(&input(old), &input(new), global).unwrap().too_late
    };
    for (old, new, expected) in [
        ("steps = 9", "steps = 8", false),
        ("steps = 9", "steps = 7", false),
        ("steps = 9", "steps = 6", true),
        ("steps = 9", "duration = 0.7", false),
        ("steps = 9", "duration = 0.6", true),
        ("steps = 9", "until_strain = { z = 0.8 }", false),
        ("steps = 9", "until_strain = { z = 0.6 }", true),
        // Whether it has been passed was not measured.
        ("steps = 9", "until_stress = { z = 5.0 }", true),
        ("until_stress = { z = 9.0 }", "until_stress = { z = 5.0 }", false),
        ("until_stress = { z = 9.0 }", "until_stress = { z = 2.0 }", true),
        // The last step of the old stage was whole.
        ("steps = 7", "steps = 9", false),
        ("duration = 0.7", "duration = 0.9", false),
    ] {
        assert_eq!(too_late(old, new, &global), expected, "{new} instead of {old}");
    }
    // It was cut.
    let cut = GlobalState { previous_time_step: 0.05, ..global };
    assert!(too_late("duration = 0.7", "duration = 0.9", &cut));
    assert!(!too_late("duration = 0.8", "duration = 0.9", &cut));
}
