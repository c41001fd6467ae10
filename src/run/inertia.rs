//! How much inertia is in the stress of a dynamic stage: the error that fast loading and density scaling make. Rank 0
//! looks at the rows of the history.

use crate::config::{Config, Routine};
use crate::output::history::HistoryRow;

/// Largest inertial number at which packings near jamming answer quasi-statically, with some room: the stress of
/// 250 spheres at 0.3 % was 4 % too high at 2e-4 and 12 % at 2e-3 (docs/quasi_static.md).
const INERTIAL_NUMBER: f64 = 2.5e-5;
/// Largest kinetic over elastic energy of such an answer.
const KINETIC_RATIO: f64 = 1e-3;

/// Follows the rows and speaks when a dynamic stage that strains the cell is over.
#[derive(Debug, Default)]
pub struct Inertia {
    last: Option<(usize, HistoryRow)>,
}

impl Inertia {
    /// A row written while stage `stage` runs (one beyond the last at the end of the run). Returns what is to be
    /// said about a stage that is over.
    pub fn follow(&mut self, config: &Config, stage: usize, row: &HistoryRow) -> Vec<String> {
        let over = self.last.filter(|(number, _)| *number != stage);
        let strains = |stage: &crate::config::Stage| stage.routine == Routine::Dynamic;
        if config.stages.get(stage).is_some_and(strains) && row.inertial_number > 0.0 && row.elastic > 0.0 {
            self.last = Some((stage, *row));
        } else if over.is_some() {
            self.last = None;
        }
        let Some((number, row)) = over else { return Vec::new() };
        let name = config.stages.get(number).map_or("", |stage| stage.name.as_str());
        lines(name, &row)
    }
}

fn lines(stage: &str, row: &HistoryRow) -> Vec<String> {
    let (number, ratio) = (row.inertial_number, row.kinetic / row.elastic);
    let strain = row.strain.iter().fold(0.0_f64, |most, strain| most.max(strain.abs()));
    let mut lines = vec![format!(
        "inertia at strain {strain:.4} (stage \"{stage}\"): inertial number {number:.1e}, kinetic over elastic energy {ratio:.1e}"
    )];
    if number > INERTIAL_NUMBER || ratio > KINETIC_RATIO {
        lines.push(format!(
            "warning: above {INERTIAL_NUMBER:.1e} or {KINETIC_RATIO:.0e} inertia raises the stress of packings near \
             jamming: lower the strain rate or density_scaling (both numbers fall with strain rate² × density scaling)"
        ));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn quickstart() -> Config {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/quickstart.toml");
        crate::config::load(&path, &[], None, None).unwrap()
    }

    fn row(inertial_number: f64, kinetic: f64) -> HistoryRow {
        HistoryRow { inertial_number, kinetic, elastic: 1.0, ..HistoryRow::default() }
    }

    #[test]
    fn a_stage_that_is_over_is_judged_by_its_last_row_under_strain() {
        let config = quickstart();
        let mut inertia = Inertia::default();
        assert!(inertia.follow(&config, 0, &row(1e-3, 1.0)).is_empty());
        assert!(inertia.follow(&config, 0, &row(1e-5, 1e-4)).is_empty());
        let said = inertia.follow(&config, 1, &row(0.0, 1e-9));
        assert!(said.len() == 1 && said[0].contains("\"compression\"): inertial number 1.0e-5"), "{said:?}");
        assert!(inertia.follow(&config, 2, &row(0.0, 1e-9)).is_empty());
    }

    #[test]
    fn either_number_above_its_threshold_warns() {
        assert!(lines("", &row(1e-4, 1e-5))[1].contains("density_scaling"));
        assert!(lines("", &row(1e-6, 1e-2))[1].contains("inertia raises the stress"));
        assert_eq!(lines("", &row(1e-6, 1e-5)).len(), 1);
    }
}
