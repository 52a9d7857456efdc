//! The quick cases of the validation are within their bars, and the list of cases is consistent. The others take the
//! release build: `sutura validate`.

use std::collections::BTreeSet;
use sutura_validate::{Section, csv, markdown, run, scenes, sections};

fn quick() -> Vec<Section> {
    let mut all = sections();
    for section in &mut all {
        section.studies.retain(|s| s.quick);
    }
    all
}

#[test]
fn quick_cases_are_within_their_bars() {
    let results = run(&quick(), 2, &|_| ());
    let missed: Vec<String> = results
        .iter()
        .flat_map(|s| {
            s.rows().filter(|(_, r)| !r.passed).map(|(study, r)| {
                format!(
                    "{} {}, {}: {:?} for {:?}, {:?}",
                    s.number, study.name, r.quantity, r.values, r.references, r.reason
                )
            })
        })
        .collect();
    assert!(missed.is_empty(), "{missed:#?}");
    assert!(results.iter().map(|s| s.rows().count()).sum::<usize>() > 30);
}

/// Results do not depend on how many run at once; tables hold every number.
#[test]
fn numbers_do_not_depend_on_the_number_of_threads() {
    let cases = || {
        let mut all = quick();
        all.retain(|s| [1, 2, 13].contains(&s.number));
        all
    };
    let (one, three) = (run(&cases(), 1, &|_| ()), run(&cases(), 3, &|_| ()));
    assert_eq!(csv(&one), csv(&three));
    let text = markdown(&one, "validation");
    assert_eq!(text, markdown(&three, "validation"));
    assert!(text.contains("## 1. ") && text.contains("| tip load k = 5 | drop / L | 0.713792 |"), "{text}");
}

#[test]
fn cases_have_names_of_their_own_and_every_scene_is_used() {
    let (mut used, mut files) = (BTreeSet::new(), BTreeSet::new());
    for section in sections() {
        let mut names = BTreeSet::new();
        for study in &section.studies {
            assert!(
                names.insert(study.name.clone()),
                "section {}: two cases are called `{}`",
                section.number,
                study.name
            );
            assert!(!study.levels.is_empty() && !study.quantities.is_empty(), "{}", study.name);
            for q in &study.quantities {
                assert!(
                    q.reference.len() <= 1 || q.reference.len() == study.levels.len(),
                    "{}, {}",
                    study.name,
                    q.name
                );
                assert!(q.reference.iter().all(|r| r.is_finite()), "{}, {}: {:?}", study.name, q.name, q.reference);
            }
            used.extend(Some(study.scene).filter(|s| !s.is_empty()));
        }
        for plot in (section.plots)(&[]) {
            assert!(files.insert(plot.file), "two plots are called `{}`", plot.file);
        }
    }
    let there: BTreeSet<&str> = scenes().iter().map(|(name, _)| *name).collect();
    assert_eq!(used, there);
}
