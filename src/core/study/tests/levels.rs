use std::collections::BTreeMap;

use super::*;
use crate::model::Bound;

fn per(more: &str) -> String {
    ONE.replace("at = \"c1.x\"\nk = ", &format!("at = \"c1.x\"\n{more}\nk = "))
}

#[test]
fn every_level_of_a_condition_has_values_of_its_own_and_an_order() {
    let folder = Folder::one(&per("per = \"i\"\nmonotone = \"rising\""));
    let study = folder.load().unwrap();
    let names: Vec<String> = study.system.free().into_iter().map(|f| f.name).collect();
    let k = |i: &str| format!("c1.x.linear_stiffness[i={i} mm].k");
    assert_eq!(names, [k("0.1"), k("0.3"), k("0.5"), "c1.x.viscous.c".to_string()]);
    let orders: Vec<_> = study.orders.iter().map(|o| (o.below.clone(), o.above.clone())).collect();
    assert_eq!(orders, [(k("0.1"), k("0.3")), (k("0.3"), k("0.5"))]);
    let falling = read(&per("per = \"i\"\nmonotone = \"falling\""), &study.dataset).unwrap();
    assert_eq!((falling.orders[0].below.clone(), falling.orders[0].above.clone()), (k("0.3"), k("0.1")));

    // A test is moved by its own level alone.
    let free = study.system.free();
    let bind = |i: f64| Bound::new(&study.system, &free, "t", &BTreeMap::from([("i".to_string(), i)]));
    assert!(bind(0.3e-3).is_ok());
    let e = bind(0.4e-3).err().unwrap();
    assert!(e.to_string().contains("per value of `i`, and none for i"), "{e}");
    assert!(e.accepted().contains("interference_law"), "{}", e.accepted());

    // Written with its values and read again it is the same study.
    let mut system = study.system.clone();
    for (i, instance) in system.instances.iter_mut().enumerate().take(3) {
        instance.params[0].value = 2e4 + 1e3 * i as f64;
    }
    let out = folder.path().join("out");
    let again = Study::load(&study.save(&system, &out).unwrap(), None).unwrap();
    assert_eq!(again.system.instances.iter().map(|i| i.params[0].value).collect::<Vec<_>>(), [2e4, 2.1e4, 2.2e4, 100.0]);
    assert_eq!(
        again.system.instances.iter().map(|i| i.only.clone()).collect::<Vec<_>>(),
        study.system.instances.iter().map(|i| i.only.clone()).collect::<Vec<_>>()
    );
    assert_eq!(again.orders.iter().map(|o| (o.below.clone(), o.above.clone())).collect::<Vec<_>>(), orders);
}

#[test]
fn what_makes_no_levels_is_refused() {
    let dataset = Folder::one(ONE).dataset();
    let case = |more: &str, message: &str, place: &str| refused(read(&per(more), &dataset), message, place);
    case("per = \"j\"", "unknown condition `j`, nearest is `i`", "key effect[0].per");
    case("per = 3", "where a string is expected", "key effect[0].per");
    case("monotone = \"rising\"", "an order along no condition", "key effect[0].monotone");
    case("per = \"i\"\nmonotone = \"up\"", "`up` is no order", "key effect[0].monotone");
    case("per = \"i\"\nonly = { i = \"0.1 mm\" }", "both stand there", "key effect[0].only");
    case("only = { i = \"0.1 N\" }", "where a length is expected", "key effect[0].only.i");
    case("only = {}", "not one condition", "key effect[0].only");
    case("only = { j = \"0.1 mm\" }", "unknown condition `j`", "key effect[0].only.j");
    let law = "per = \"i\"\nk = \"20 N/mm\"\n[[effect]]\neffect = \"interference_law\"\nat = \"c1.x\"\nof = \"linear_stiffness.k\"\ncondition = \"i\"\nreference = \"0.1 mm\"\na = \"0 1/mm\"\n[[effect]]\neffect = \"cubic_stiffness\"\nat = \"c1.x\"\n";
    let text = ONE.replace("at = \"c1.x\"\nk = { start = \"20 N/mm\", min = \"0 N/mm\" }", &format!("at = \"c1.x\"\n{law}k = \"1 N/mm3\""));
    refused(read(&text, &dataset), "per value of a condition", "key effect[1]");
    // One value of the condition in every test.
    let one = Folder::new(ONE, &[1.0, 2.0, 5.0].map(|hz| cycle(hz, ", i = \"0.1 mm\"")).concat()).dataset();
    refused(read(&per("per = \"i\""), &one), "every test has the same `i`", "key effect[0].per");
}
