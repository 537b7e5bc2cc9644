use crate::study::Study;
#[test]
fn zz_slopes() {
    let study = Study::load(std::path::Path::new("studies/measured/silverbox/by-hand.toml"), Some(std::path::Path::new("/work/shared/data/silverbox"))).unwrap();
    let case = crate::diagnose::Case::from_study(&study, 1).unwrap();
    let plan = &case.plans[0].0;
    let mut system = case.system.clone();
    let free = system.free();
    for f in &free { let p = &mut system.instances[f.instance].params[f.param]; println!("{} {} log {}", f.name, p.value, f.log); }
    let run = |s: &crate::model::System, sens| plan.evaluate(s, &free, sens).unwrap();
    let base = run(&system, true);
    for (k, f) in free.iter().enumerate() {
        let v = system.instances[f.instance].params[f.param].value;
        for h in [1e-3, 1e-5] {
        let h = if v != 0.0 { h * v.abs() } else { h * 1e-3 };
        let at = |h: f64| { let mut s = system.clone(); s.instances[f.instance].params[f.param].value += h; run(&s, false).values };
        let (a, b) = (at(h), at(-h));
        let (mut gap, mut size, mut dot, mut own) = (0.0f64, 0.0f64, 0.0, 0.0);
        for i in 0..a.len() { let n = (a[i]-b[i])/(2.0*h); let s = base.slopes[i*free.len()+k] / if f.log { v } else { 1.0 }; gap += (n-s).powi(2); size += n*n; dot += n*s; own += s*s; }
        println!("{} h {h:.1e}: rel gap {:.3e} cos {:.4} ratio {:.3}", f.name, (gap/size).sqrt(), dot/(size*own).sqrt(), (own/size).sqrt());
        }
    }
}
