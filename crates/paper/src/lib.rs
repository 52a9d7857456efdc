//! The experiments of "Real-time inextensible surgical thread simulation" (International Journal of Computer Assisted
//! Radiology and Surgery 13:1019, 2018), figures 8 to 18: run on the paper's own solver, on the methods that it
//! compares with, and on Sutura's own solver.
//!
//! [`experiments`] lists them, [`run`] runs them side by side, [`page`] writes what was found as one page. Everything
//! found is data; drawing and files are the caller's. What is found depends on nothing but the code; times do, and are
//! kept apart ([`Table::measured`]).

mod fig08;
mod fig09;
mod fig10;
mod fig12;
mod fig13;
mod fig16;
mod fig17;
mod fig18;
mod helix;
mod led;
mod limits;
mod measure;
mod method;
mod outcome;
mod page;
mod plan;
mod scale;

pub use outcome::{Axis, Cell, Check, Compare, Curve, Grid, Outcome, Panel, Picture, Plot, Solid, Table, Tube};
pub use page::{page, table};
pub use plan::{Experiment, Progress, Result, run};

/// All experiments, in the order of the figures.
pub fn experiments() -> Vec<Experiment> {
    vec![
        fig08::EXPERIMENT,
        fig09::EXPERIMENT,
        fig10::EXPERIMENT,
        fig12::EXPERIMENT,
        fig13::EXPERIMENT,
        scale::EXPERIMENT,
        fig16::EXPERIMENT,
        fig17::EXPERIMENT,
        fig18::EXPERIMENT,
        limits::EXPERIMENT,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Plan;

    #[test]
    fn names_are_unique() {
        let mut names: Vec<&str> = experiments().iter().map(|e| e.name).collect();
        names.sort_unstable();
        let n = names.len();
        names.dedup();
        assert_eq!(names.len(), n);
        assert!(!names.contains(&"all"), "that means all of them");
    }

    #[test]
    fn what_is_found_does_not_hang_on_the_number_of_jobs() {
        fn tiny() -> Plan {
            let finish = |found: &[(f64, f64)]| {
                let mut t = Table::new("roots", "Roots", &["x", "root, of x"]);
                for (x, root) in found {
                    t.row([(*x).into(), (*root).into()]);
                }
                Outcome { tables: vec![t], ..Outcome::default() }
            };
            Plan::new((0..20).map(f64::from).collect(), f64::to_string, |x| x.sqrt(), finish)
        }
        let csv = |jobs: usize| {
            let one = Experiment { name: "tiny", title: "", figures: "", plan: tiny };
            let found = run(&[one], jobs, &|_| ());
            found[0].outcome.tables.iter().map(Table::csv).collect::<Vec<_>>()
        };
        let once = csv(1);
        assert_eq!(once, csv(4));
        assert!(once[0].starts_with("x,\"root, of x\"\n0,0\n1,1\n2,1.4142135623730951\n"), "{once:?}");
    }
}
