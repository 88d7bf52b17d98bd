use super::{run::Run, statements};

fn run(touches: [usize; 3]) -> Run {
    Run {
        touches: touches.to_vec(),
        least: touches.map(|count| if count > 0 { 0.0 } else { 0.1 }).to_vec(),
        ..Run::new(1.0, 3, 5)
    }
}

fn names() -> Vec<String> {
    ["leading_edge", "mid_chord", "trailing_edge"].map(String::from).to_vec()
}

/// A node that stays away, or touches only once, does not agree with figure 11.
#[test]
fn every_node_must_touch_repeatedly() {
    let holds = |touches| statements::all_nodes_touch(&run(touches), &names(), 1.0).holds;
    assert_eq!(holds([3, 2, 9]), Some(true));
    assert_eq!([holds([0, 12, 12]), holds([1, 12, 12])], [Some(false); 2]);
    let found = statements::all_nodes_touch(&run([0, 12, 12]), &names(), 1.0).found;
    assert!(found.contains("leading edge 0.100 of the clearance at rest, 0 contacts"), "{found}");
}

/// Ratios that an average over the slowest and fastest third would accept.
#[test]
fn fraction_that_persists_or_rises_is_not_negligible() {
    let holds = |ratios: &[f64]| {
        let shares: Vec<(f64, f64)> =
            ratios.iter().zip(1_u32..).map(|(share, speed)| (f64::from(speed), *share)).collect();
        statements::becomes_negligible(&shares, "").holds
    };
    assert_eq!(holds(&[0.9, 0.3, 0.05]), Some(true));
    for ratios in [&[4.85, 0.26, 0.84][..], &[0.9, 0.3, 0.2], &[0.05, 0.04, 0.06], &[0.9, f64::NAN, 0.05]] {
        assert_eq!(holds(ratios), Some(false), "{ratios:?}");
    }
    assert_eq!(holds(&[4.85, 0.01]), None);
}

/// Nothing is stated about speeds without a run.
#[test]
fn verdict_uses_every_run_above_the_critical_speed() {
    let holds = |shares: &[(f64, f64)]| statements::prevails(shares, 2.0).holds;
    assert_eq!(holds(&[(1.0, 5.0), (2.0, 0.9), (3.0, 0.8)]), Some(true));
    assert_eq!(holds(&[(1.0, 0.5), (2.0, 0.9), (3.0, 1.2)]), Some(false));
    assert_eq!(holds(&[(2.0, f64::NAN)]), Some(false));
    assert_eq!(holds(&[(1.0, 0.5)]), None);
}
