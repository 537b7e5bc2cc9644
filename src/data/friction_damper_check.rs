//! Development check on measured loops that are not part of the repository: `MISFIT_FRICTION_DAMPER=<folder> cargo test --release friction_damper -- --ignored --nocapture`.

use super::{Dataset, Record, Role};
use std::path::PathBuf;

#[test]
#[ignore = "needs the public friction-damper data, which are not in the repository"]
fn measured_loops_of_the_friction_damper() {
    let folder = PathBuf::from(std::env::var_os("MISFIT_FRICTION_DAMPER").expect("MISFIT_FRICTION_DAMPER names the folder of the data"));
    let names = [("0.5Hz-1.0in", 0.5), ("1Hz-0.5in", 1.0), ("1Hz-1.5in", 1.0), ("2Hz-0.5in", 2.0)];
    let test = |(name, f): &(&str, f64)| {
        format!(
            "[[test]]\nid = \"{name}\"\nkind = \"cycle\"\nfile = \"{name}.csv\"\ncontrol = \"displacement\"\ndiscard_cycles = 2\nconditions = {{ frequency = \"{f} Hz\" }}\n\
             channels = [\n{{ role = \"time\", column = \"time [s]\", unit = \"s\" }},\n{{ role = \"displacement\", at = \"c1.x\", column = \"displacement [in]\", unit = \"in\" }},\n\
             {{ role = \"velocity\", at = \"c1.x\", column = \"velocity [in/s]\", unit = \"in/s\" }},\n{{ role = \"force\", at = \"c1.x\", column = \"force [kip]\", unit = \"kip\" }}]\n"
        )
    };
    let toml = "schema = 1\n".to_string() + &names.iter().map(test).collect::<String>();
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("dataset.toml"), toml).unwrap();
    let d = Dataset::load(dir.path(), Some(&folder)).unwrap();
    for (t, (_, declared)) in d.tests.iter().zip(names) {
        let Record::Cycle(r) = &t.record else { panic!() };
        let l = r.settled().unwrap();
        let mut h = r.history();
        let recorded = h.channel(Role::Velocity, "c1.x").unwrap().values.clone();
        h.channels.retain(|c| c.role != Role::Velocity);
        let m = h.motion("c1.x").unwrap();
        let rms = |v: &[f64]| (v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64).sqrt();
        // A sensor chain delays: the lag that fits best, by linear regression of the difference on the derivative.
        let (va, av): (f64, f64) =
            m.velocity.iter().zip(&m.acceleration).zip(&recorded).fold((0.0, 0.0), |(va, av), ((v, a), r)| (va + (v - r) * a, av + a * a));
        let lag = va / av;
        let lagged: Vec<f64> = m.velocity.iter().zip(&m.acceleration).zip(&recorded).map(|((v, a), r)| v - lag * a - r).collect();
        let difference: Vec<f64> = m.velocity.iter().zip(&recorded).map(|(a, b)| a - b).collect();
        let smooth: f64 =
            rms(&m.displacement.iter().zip(&h.channel(Role::Displacement, "c1.x").unwrap().values).map(|(a, b)| a - b).collect::<Vec<_>>());
        let amplitude = (l.input.sin[0].powi(2) + l.input.cos[0].powi(2)).sqrt() / 0.0254;
        println!(
            "{}: {:.6} Hz, {} cycles of {} points, amplitude {amplitude:.4} in, {} harmonics; sigma x {:.2e} in, F {:.4} kip; \
             velocity against recorded {:.2} % rms ({:.2} % with a lag of {:.2} ms), cutoff {:.1} Hz, smoothing moves x by {:.1e} in",
            t.id,
            l.frequency,
            l.cycles,
            l.n,
            l.input.harmonics(),
            l.channels[0].sigma_sample / 0.0254,
            l.channels[2].sigma_sample / 4448.2216,
            100.0 * rms(&difference) / rms(&recorded),
            100.0 * rms(&lagged) / rms(&recorded),
            1e3 * lag,
            m.cutoff.unwrap(),
            smooth / 0.0254
        );
        l.notes.iter().for_each(|n| println!("    {}: {}", n.about, n.text));
        assert!((l.frequency / declared - 1.0).abs() < 0.01);
        assert!(rms(&difference) < 0.1 * rms(&recorded));
    }
}
