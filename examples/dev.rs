use misfit::diagnose::{results::SplitName, *};
use misfit::identify::Monitor;
use misfit::response::Plan;
use std::sync::Arc;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let data = std::env::args().nth(3);
    let study = misfit::study::Study::load(path.as_ref(), data.as_ref().map(|d| d.as_ref())).unwrap();
    let t0 = std::time::Instant::now();
    let plans = study
        .dataset
        .tests
        .iter()
        .map(|t| {
            let s = match study.split.word(&t.id) {
                "select" => SplitName::Select,
                "held_out" => SplitName::HeldOut,
                _ => SplitName::Fit,
            };
            (Plan::new(t, &study.system.model).unwrap(), s)
        })
        .collect();
    let case = Case {
        name: study.title.clone(),
        plans: Arc::new(plans),
        system: study.system.clone(),
        orders: study.orders.iter().map(|o| (o.below.clone(), o.above.clone(), o.gap)).collect(),
        loss: study.fit.loss,
        max_iterations: 200,
        starts: study.fit.starts.max(1),
        seed: 1,
        search: Search { effects: study.search.effects.clone(), places: study.search.places.clone(), max_added: study.search.max_added },
    };
    let watch = |s: &str| eprintln!("[{:6.2}] {s}", t0.elapsed().as_secs_f64());
    if std::env::args().nth(2).as_deref() == Some("fit") {
        let (_, _, r) = fit(&case, &[SplitName::Fit, SplitName::Select, SplitName::HeldOut], &Monitor::default()).unwrap();
        println!("{} cost {:.5e} it {} wall {:.2}", r.termination, r.cost, r.iterations, r.wall_s);
        for t in &r.tests {
            println!(
                "  {:24} {:?} error {:.4} floor {:.4} ratio {:.2} rms {:.3}  worst {}",
                t.id,
                t.split,
                t.error,
                t.floor,
                t.error / t.floor,
                t.whitened_rms,
                t.worst.place
            );
        }
        for p in &r.parameters {
            println!("  {} = {} {:?}", p.name, p.printed, p.interval);
        }
        for n in &r.notes {
            println!("  note {n}");
        }
        return;
    }
    if std::env::args().nth(2).as_deref() == Some("time") {
        let (c, f, _) = fit(&case, &[SplitName::Fit], &Monitor::default()).unwrap();
        for (p, _) in c.plans.iter() {
            let t = std::time::Instant::now();
            for _ in 0..5 {
                p.evaluate(&f.system, &f.free, false).unwrap();
            }
            let a = t.elapsed().as_secs_f64() / 5.0;
            let t = std::time::Instant::now();
            for _ in 0..5 {
                p.evaluate(&f.system, &f.free, true).unwrap();
            }
            println!("{:20} n {} value {:.2} ms, with slopes {:.2} ms", p.id, p.len(), a * 1e3, t.elapsed().as_secs_f64() / 5.0 * 1e3);
        }
        return;
    }
    let (l, _) = ladder(&case, &Monitor::default(), &watch).unwrap();
    for r in &l.rungs {
        println!("== added {:?} removed {:?} {} cost {:.4e}", r.added, r.removed, r.termination, r.cost);
        for t in &r.tests {
            println!(
                "  {:24} {:?} error {:.4} floor {:.4} ratio {:.2} rms {:.3}",
                t.id,
                t.split,
                t.error,
                t.floor,
                t.error / t.floor,
                t.whitened_rms
            );
        }
        for p in &r.parameters {
            println!("  {} = {} {:?}", p.name, p.printed, p.interval);
        }
        for c in r.candidates.iter().take(12) {
            println!(
                "    cand {} {} {:?} drop {:.4} p {:.4} after {:?}/{:.3} {} {:?} | {}",
                c.effect, c.at, c.of, c.predicted_drop, c.p_value, c.error_after, c.error_before, c.accepted, c.tied_with, c.remark
            );
        }
    }
    println!("{:?} missing {:?} held {:?} {} next {:?} wall {:.1}", l.verdict, l.missing, l.held_out, l.ended, l.next_test, l.wall_s);
}
