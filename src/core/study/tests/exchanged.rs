//! A law that others act on, exchanged with them.

use super::{Folder, ONE};
use crate::diagnose::Case;
use crate::diagnose::testing::{Added, Climb, Name, begin};
use crate::effect::{Sign, find};
use crate::identify::Monitor;
use crate::model::{Instance, ParamValue, Site, Target};

fn law(effect: &str, values: &[f64], target: Option<Target>) -> Instance {
    let effect = find(effect).unwrap();
    let value = |(v, p): (&f64, &crate::effect::Param)| ParamValue::free(*v, p.sign);
    let params = values.iter().zip(effect.info().params).map(value).collect();
    Instance { target, ..Instance::new(effect, "c1.x", Site::Places(vec![0]), params) }
}

/// Loops of an elastic slip whose limit grows with the interference (0.1, 0.3, 0.5 mm), which a film with a law over that was taken for.
#[test]
fn a_friction_is_exchanged_with_the_law_that_acts_on_its_limit() {
    let folder = Folder::one(&ONE.replace("split = { select = [\"loop-2Hz\"], held_out = [\"loop-5Hz\"] }\n", ""));
    for (hz, limit) in [(1.0, 2.0 * (-0.3f64).exp()), (2.0, 2.0), (5.0, 2.0 * 0.3f64.exp())] {
        let x = |part: f64| 0.4 * (std::f64::consts::TAU * part).sin();
        let (mut u, mut csv) = (0.0f64, "t,x,F\n".to_string());
        for i in 0..500 {
            let part = f64::from(i) * 0.01;
            for step in 0..50 {
                let at = part - 0.01 + 0.0002 * f64::from(step);
                u = (u + (x(at + 0.0002) - x(at)) / 0.03).clamp(-1.0, 1.0);
            }
            let noise = 0.02 * (12.9898 * f64::from(i) + 78.233 * hz).sin();
            csv += &format!("{:.6},{:.8},{:.8}\n", part / hz, x(part), 20.0 * x(part) + limit * u + noise);
        }
        std::fs::write(folder.path().join(format!("data/loop-{hz}.csv")), csv).unwrap();
    }
    let case = Case::from_study(&folder.load().unwrap(), 1).unwrap();
    let (quiet, silent) = (Monitor::default(), |_: &str| {});
    let began = begin(&case, &quiet).unwrap();
    let mut climb = Climb::new(&began.case, &began.fitted, &quiet, &silent).unwrap();
    let mut system = climb.now.fitted.system.clone();
    let film = system.instances.len();
    let unit = crate::units::Unit::si(crate::units::Dimension::LENGTH);
    let grows = Target { instances: vec![film], param: 0, condition: "i".into(), reference: 3e-4, unit };
    system.instances.extend([law("film", &[0.4, 5e-5, 6e-6], None), law("interference_law", &[1500.0], Some(grows))]);
    climb.now = climb.scale.weigh(&system, &climb.now.v, &quiet).unwrap();
    let name = |effect, of: Option<&str>| Name { effect, at: "c1.x".into(), of: of.map(String::from) };
    let slip = law("elastic_slip", &[1.8, 2e-5], None);
    climb.added = vec![Added::new(name("film", None)), Added::new(name("interference_law", Some("film.f over i")))];
    climb.added[0].kin = vec![(name("elastic_slip", None), slip)];
    let (added, removed) = climb.replace(None).unwrap();
    assert_eq!((added.effect.as_str(), removed.effect.as_str()), ("elastic_slip", "film"));
    let names: Vec<&Name> = climb.added.iter().map(|a| &a.name).collect();
    assert_eq!(names, [&name("elastic_slip", None), &name("interference_law", Some("elastic_slip.f over i"))]);
    let now = &climb.now.fitted.system;
    assert_eq!(now.instances[film].name(), "elastic_slip");
    let (limit, growth) = (now.instances[film].params[0].value, now.instances[film + 1].params[0].value);
    assert!((limit / 2.0 - 1.0).abs() < 0.03 && (growth / 1500.0 - 1.0).abs() < 0.1, "{limit} N, {growth} 1/m");
    assert_eq!(climb.added[0].kin[0].0, name("film", None), "it can be exchanged back");
    assert_eq!(now.instances[film].params[0].min, Sign::NonNegative.lowest());
}
