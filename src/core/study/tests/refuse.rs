use super::*;

/// Each change of the contract's first example, the message, and where it is.
#[test]
fn one_connector() {
    let dataset = Folder::one(ONE).dataset();
    let case = |from: &str, to: &str, message: &str, place: &str| {
        assert!(ONE.contains(from), "{from}");
        refused(read(&ONE.replacen(from, to, 1), &dataset), message, place);
    };
    // The file.
    case("schema = 1", "schema = 3", "schema 3 is not known", "study.toml, line 1, key schema");
    case("schema = 1", "", "required key `schema` is missing", "study.toml, line 1");
    case("schema = 1", "shema = 1", "unknown key `shema`, nearest is `schema`", "line 1, key shema");
    case(
        "[[effect]]\neffect = \"viscous\"",
        "[[efect]]\neffect = \"viscous\"",
        "unknown key `efect`, nearest is `effect`",
        "line 18, key efect",
    );
    case("[[body]]\nname = \"end\"", "[[body]\nname = \"end\"", "not valid TOML", "line 7");
    // Split.
    case("\"loop-2Hz\"", "\"loop-3Hz\"", "unknown test `loop-3Hz`, nearest is `loop-", "line 3, key split.select[0]");
    case("\"loop-2Hz\"", "\"loop-5Hz\"", "test `loop-5Hz` stands in select and in held_out", "key split.held_out[0]");
    case("\"loop-2Hz\"", "\"loop-2Hz\", \"loop-2Hz\"", "test `loop-2Hz` stands twice in select", "key split.select[1]");
    case("\"loop-2Hz\"", "\"loop-2Hz\", \"loop-1Hz\"", "nothing is left to fit", "line 3, key split");
    case("held_out", "heldout", "unknown key `heldout`, nearest is `held_out`", "key split.heldout");
    case("[\"loop-2Hz\"]", "\"loop-2Hz\"", "where a list is expected", "key split.select");
    // Bodies.
    case("name = \"end\"", "name = \"ground\"", "body `ground` stands twice, first in line 5", "line 8, key body[1].name");
    case("name = \"end\"", "name = \"e nd\"", "`e nd` is not a name", "key body[1].name");
    case("name = \"end\"", "name = \"e.nd\"", "cannot be a name", "key body[1].name");
    case("name = \"end\"                 # massless, driven\n", "", "required key `name` is missing", "line 7, key body[1]");
    case("free = [\"x\"]", "fre = [\"x\"]", "unknown key `fre`, nearest is `free`", "line 9, key body[1].fre");
    case("free = [\"x\"]", "free = [\"w\"]", "unknown axis `w`", "key body[1].free[0]");
    case("free = [\"x\"]", "free = [\"x\", \"x\"]", "the axis `x` stands twice", "key body[1].free[1]");
    case("free = [\"x\"]", "free = []", "no free axis", "key body[1].free");
    case("free = [\"x\"]", "", "required key `free` is missing", "line 7, key body[1]");
    case("free = [\"x\"]", "free = [\"x\"]\nfixed = true", "is fixed and has free axes", "key body[1].free");
    case("free = [\"x\"]", "free = [\"x\"]\nmass = \"3 mm\"", "where a mass is expected", "line 10, key body[1].mass");
    case("free = [\"x\"]", "free = [\"x\"]\nmass = \"-3 kg\"", "the mass of body `end` is -3 kg", "key body[1].mass");
    case("free = [\"x\"]", "free = [\"x\"]\nmass = \"nan kg\"", "not a finite number", "key body[1].mass");
    case("free = [\"x\"]", "free = [\"x\"]\nmass = 3", "has no unit", "key body[1].mass");
    case("free = [\"x\"]", "free = [\"x\"]\ncount = 0", "0 is out of range", "key body[1].count");
    case(
        "fixed = true",
        "free = [\"x\"]\n[[body]]\nname = \"loose\"\nfree = [\"x\"]",
        "no connector reaches body `loose`",
        "line 7, key body[1]",
    );
    case("free = [\"x\"]", "fixed = true", "nothing can move", "study.toml, line 1");
    // Connectors.
    case("to = \"end\"", "to = \"ende\"", "unknown body `ende`, nearest is `end`", "line 13, key connector[0].to");
    case("to = \"end\"", "to = \"ground\"", "joins body `ground` to itself", "line 10, key connector[0]");
    case("to = \"end\"", "", "required key `to` is missing", "key connector[0]");
    case("to = \"end\"", "to = \"end\"\nchain = \"end\"", "is a chain and has an end", "key connector[0].from");
    case("from = \"ground\"\nto = \"end\"", "chain = \"end\"", "body `end` has no count", "line 12, key connector[0].chain");
    case("name = \"c1\"", "name = \"end\"", "body and connector `end` stands twice", "key connector[0].name");
    // Effects.
    case("effect = \"viscous\"", "effect = \"viscos\"", "unknown effect `viscos`, nearest is `viscous`", "line 19, key effect[1].effect");
    case("effect = \"viscous\"\n", "", "required key `effect` is missing", "line 18, key effect[1]");
    case("at = \"c1.x\"\nk", "at = \"c2.x\"\nk", "there is no place `c2.x`; the nearest is `c1.x`", "line 16, key effect[0].at");
    case("at = \"c1.x\"\nk", "at = \"c1.y\"\nk", "there is no place `c1.y`", "key effect[0].at");
    case("at = \"c1.x\"\nk", "at = \"c1.q\"\nk", "there is no axis `q`", "key effect[0].at");
    case("at = \"c1.x\"\nk", "at = \"c1\"\nk", "`c1` names no axis", "key effect[0].at");
    case("at = \"c1.x\"\nk", "at = [\"c1.x\", \"c1.x\"]\nk", "stands twice among the places", "key effect[0].at[1]");
    case("at = \"c1.x\"\nk", "at = []\nk", "an empty list of places", "key effect[0].at");
    case("at = \"c1.x\"\nk", "at = 3\nk", "found the integer 3", "key effect[0].at");
    // Parameters.
    case("k = { start", "q = { start", "unknown key `q`", "line 17, key effect[0].q");
    case("k = { start = \"20 N/mm\", min = \"0 N/mm\" }", "", "required key `k` is missing", "line 14, key effect[0]");
    case("20 N/mm", "20 mm", "`20 mm` is a length (m), where a stiffness is expected", "line 17, key effect[0].k.start");
    case("20 N/mm", "20", "has no unit", "key effect[0].k.start");
    case("20 N/mm", "20 N/mmm", "unknown unit `mmm`", "key effect[0].k.start");
    case("20 N/mm", "inf N/mm", "not a finite number", "key effect[0].k.start");
    case("20 N/mm", "", "empty where a quantity is expected", "key effect[0].k.start");
    case("{ start = \"20 N/mm\", min", "{ strat = \"20 N/mm\", min", "unknown key `strat`, nearest is `start`", "key effect[0].k.strat");
    case("min = \"0 N/mm\"", "min = \"30 N/mm\"", "start 20 N/mm is below min 30 N/mm", "line 17, key effect[0].k");
    case("min = \"0 N/mm\"", "max = \"10 N/mm\"", "start 20 N/mm is above max 10 N/mm", "key effect[0].k");
    case("min = \"0 N/mm\"", "min = \"9 N/mm\", max = \"3 N/mm\"", "is not below max", "key effect[0].k");
    case("min = \"0 N/mm\"", "min = \"-1 N/mm\"", "lets `k` be negative", "key effect[0].k.min");
    case("\"20 N/mm\", min = \"0 N/mm\"", "\"-20 N/mm\"", "`k` is -20 N/mm", "key effect[0].k.start");
    case("min = \"0 N/mm\"", "prior = { mean = \"3 N/mm\" }", "required key `sigma` is missing", "key effect[0].k.prior");
    case("min = \"0 N/mm\"", "fixed = 1", "where true or false is expected", "key effect[0].k.fixed");
    case("min = \"0 N/mm\"", "free = true", "unknown key `free`", "key effect[0].k.free");
}

#[test]
fn effects_that_cannot_act_there() {
    let dataset = Folder::one(ONE).dataset();
    let add = |effect: &str, message: &str, place: &str| refused(read(&format!("{ONE}[[effect]]\n{effect}"), &dataset), message, place);
    add("effect = \"maxwell\"\nat = \"c1.x\"\nk = \"1 N/mm\"\n", "required key `tau` is missing", "key effect[2]");
    add("effect = \"maxwell\"\nat = \"c1.x\"\nk = \"1 N/mm\"\ntau = \"0 s\"\n", "`tau` is 0 s", "key effect[2].tau");
    add(
        "effect = \"coulomb\"\nat = \"c1.x\"\nf = \"1 N\"\nvr = { start = \"1 mm/s\", free = true, fixed = true }\n",
        "free and fixed both",
        "key effect[2].vr.free",
    );
    add("effect = \"delay\"\nat = \"c1.x\"\ntau = \"1 ms\"\n", "there is no test `c1`", "line 24, key effect[2].at");
    add("effect = \"delay\"\nat = \"loop-1Hz.forse\"\ntau = \"1 ms\"\n", "nearest is `loop-1Hz.force`", "key effect[2].at");
    add(
        "effect = \"delay\"\nat = [\"loop-1Hz.force\", \"loop-2Hz.force\"]\ntau = \"1 ms\"\n",
        "acts on one channel",
        "key effect[2].at[1]",
    );
    add("effect = \"coulomb\"\nat = \"loop-1Hz.force\"\nf = \"1 N\"\n", "there is no axis `force`", "key effect[2].at");
    add(
        "effect = \"moving_mass\"\nat = \"loop-1Hz.displacement\"\nm = \"1 kg\"\n",
        "acts on what a load cell reads, and `loop-1Hz.displacement` is a displacement",
        "line 24, key effect[2].at",
    );
    add(
        "effect = \"accelerometer_mass\"\nat = \"loop-1Hz.force\"\nm = \"1 kg\"\n",
        "acts on the responses of FRFs, and `loop-1Hz.force` is a force",
        "line 24, key effect[2].at",
    );
    add("effect = \"offset\"\nat = \"loop-1Hz.force\"\nb = \"1 mm\"\n", "where a force is expected", "key effect[2].b");
    let law =
        "effect = \"interference_law\"\nat = \"c1.x\"\nof = \"viscous.c\"\ncondition = \"i\"\nreference = \"0.3 mm\"\na = \"0.2 1/mm\"\n";
    let law = |from: &str, to: &str, message: &str, place: &str| add(&law.replace(from, to), message, place);
    law("viscous.c", "viscos.c", "there is no parameter `viscos.c`; the nearest is `viscous.c`", "line 25, key effect[2].of");
    law("of = \"viscous.c\"\n", "", "several effects act at `c1.x`", "key effect[2].at");
    law("\"i\"", "\"j\"", "unknown condition `j`", "key effect[2].condition");
    law("condition = \"i\"\n", "", "required key `condition` is missing", "key effect[2]");
    law("0.3 mm", "0.3 N", "where a length is expected", "key effect[2].reference");
    law("reference = \"0.3 mm\"\n", "", "required key `reference` is missing", "key effect[2]");
    law("0.2 1/mm", "0.2 1/N", "expected", "key effect[2].a");
}

#[test]
fn a_condition_that_a_test_does_not_state() {
    let law = "[[effect]]\neffect = \"interference_law\"\nat = \"c1.x\"\nof = \"viscous.c\"\ncondition = \"i\"\nreference = \"0.3 mm\"\na = \"0.2 1/mm\"\n";
    let text = format!("{ONE}{law}");
    let folder = Folder::one(&text);
    let file = folder.path().join("data/dataset.toml");
    let whole = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, whole.replace(", i = \"0.3 mm\"", "")).unwrap();
    refused(folder.load(), "test `loop-2Hz`, condition `i`: it does not state", "dataset.toml, line 12, test loop-2Hz, condition `i`");
    std::fs::write(&file, whole.replace("i = \"0.3 mm\"", "i = \"0.3 N\"")).unwrap();
    refused(folder.load(), "it is a force, and a length in another test", "test loop-2Hz, condition `i`");
}

#[test]
fn a_dataset_that_does_not_fit_the_model() {
    let folder = Folder::one(ONE);
    let file = folder.path().join("data/dataset.toml");
    let whole = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, whole.replacen("at=\"c1.x\", column=\"F\"", "at=\"c7.x\", column=\"F\"", 1)).unwrap();
    let place = "dataset.toml, line 2, test loop-1Hz, channel force at c7.x";
    refused(folder.load(), "there is no place `c7.x`; the nearest is `c1.x` in the model", place);
    std::fs::remove_file(&file).unwrap();
    refused(folder.load(), "no dataset.toml at", "study.toml, line 2, key dataset");
    let chain = Folder::chain(&CHAIN.replace("count = 8", "count = 7").replace("c1-7", "c1-6"));
    refused(chain.load(), "there is no place `m8.x`", "test frf-a, respond");
    let e = Study::load(Path::new("/nowhere/study.toml"), None).unwrap_err();
    assert!(e.to_string().contains("cannot be read") && e.stage() == "study", "{e}");
}

#[test]
fn chains() {
    let dataset = Folder::chain(CHAIN).dataset();
    let case = |from: &str, to: &str, message: &str, place: &str| {
        assert!(CHAIN.contains(from), "{from}");
        refused(read(&CHAIN.replacen(from, to, 1), &dataset), message, place);
    };
    case("chain = \"m\"", "chain = \"mm\"", "unknown body `mm`, nearest is `m`", "line 14, key connector[1].chain");
    case("name = \"base\"", "name = \"c3\"", "connector `c3` stands twice, first in line 9", "line 13, key connector[1].name");
    case("to = \"m1\"", "to = \"m9\"", "unknown body `m9`, nearest is `m", "key connector[0].to");
    case("from = \"ground\"", "from = \"grund\"", "unknown body `grund`, nearest is `ground`", "key connector[0].from");
    case("at = \"c1-7.x\"", "at = \"c1-8.x\"", "there is no place `c8.x`", "line 21, key effect[1].at");
    case("at = \"c1-7.x\"", "at = \"c7-1.x\"", "runs backwards", "line 21, key effect[1].at");
    case(
        "[[effect]]\neffect = \"linear_stiffness\"\nat = \"base.x\"",
        "[[body]]\nname = \"m4\"\nfixed = true\n[[effect]]\neffect = \"linear_stiffness\"\nat = \"base.x\"",
        "body `m4` stands twice, first in line 4",
        "key body[1].name",
    );
    // The FRF needs m8; a chain over one body is refused before that.
    case("count = 8", "count = 1", "body `m` has count 1", "key connector[1].chain");
    // One value for several places cannot be scaled in part by a law that covers more.
    let law = "[[effect]]\neffect = \"interference_law\"\nat = [\"base.x\", \"c1.x\"]\ncondition = \"frequency\"\nreference = \"1 Hz\"\na = \"0 s\"\n";
    refused(read(&format!("{CHAIN}{law}"), &dataset), "do not share one value", "key effect[2].at");
}

#[test]
fn mechanisms() {
    let dataset = Folder::chain(CHAIN).dataset();
    // Nothing acts at c4: m5 to m8 are joined to the rest by a connector without a force.
    let cut = CHAIN.replace("at = \"c1-7.x\"", "at = [\"c1-3.x\", \"c5-7.x\"]");
    refused(read(&cut, &dataset), "a mechanism: no force holds `m5.x`, `m6.x`, `m7.x`, `m8.x`", "line 3, key body[0]");
    let e = read(&cut, &dataset).unwrap_err();
    assert_eq!(e.accepted(), "a force effect at `c4.x`, or the axis left out of `free`");
    // A freedom nobody holds.
    let sideways = CHAIN.replace("free = [\"x\"]", "free = [\"x\", \"y\"]");
    refused(read(&sideways, &dataset), "no force holds `m1.y`", "key body[0]");
    // A free-free chain floats, but has mass.
    let base = &CHAIN[CHAIN.find("[[connector]]\nname = \"base\"").unwrap()..CHAIN.find("[[connector]]\nname = \"c\"").unwrap()];
    let spring = "[[effect]]\neffect = \"linear_stiffness\"\nat = \"base.x\"\nk = \"150 N/mm\"\n";
    let floating = CHAIN.replace(base, "").replace(spring, "");
    assert!(read(&floating, &dataset).is_ok());
    refused(read(&floating.replace("mass = \"0.1 kg\"\n", ""), &dataset), "a mechanism", "key body[0]");
    // A series effect where no force acts.
    let series = "[[effect]]\neffect = \"backlash\"\nat = \"c1.x\"\ng = \"1 um\"\nf_close = \"1 N\"\n";
    let alone = CHAIN.replace("at = \"c1-7.x\"", "at = \"c2-7.x\"") + series;
    refused(read(&alone, &dataset), "stands in series with nothing", "key effect[2].at");
}

#[test]
fn orders() {
    let c = "effect = \"viscous\"\nat = \"c1.x\"\nc = { start = \"0.1 N s/mm\", min = \"0 N s/mm\" }\n";
    let two = format!("{ONE}[[effect]]\n{c}[[effect]]\n{c}");
    let dataset = Folder::one(ONE).dataset();
    let names = ["c1.x.viscous.c", "c1.x.viscous#2.c", "c1.x.viscous#3.c"];
    let order = |list: &str| format!("[[order]]\norder = [{list}]\n");
    let all = names.map(|n| format!("\"{n}\"")).join(", ");
    let study = read(&(two.clone() + &order(&all)), &dataset).unwrap();
    assert_eq!(study.orders.len(), 2);
    let constraints = study.constraints(&study.system, &study.system.free()).unwrap();
    assert_eq!(constraints.orders.iter().map(|o| (o.below, o.above)).collect::<Vec<_>>(), [(1, 2), (2, 3)]);
    // An effect that is gone takes its orders with it.
    let mut pruned = study.system.clone();
    pruned.instances.pop();
    assert_eq!(study.constraints(&pruned, &pruned.free()).unwrap().orders.len(), 1);
    let case = |text: &str, message: &str, place: &str| refused(read(&(two.clone() + text), &dataset), message, place);
    case(&order("\"c1.x.viscous.c\", \"c1.x.viscous#2.d\""), "nearest is `c1.x.viscous#2.c`", "line 31, key order[0].order[1]");
    case(&order("\"c1.x.viscous.c\""), "fewer than two", "key order[0].order");
    case(&order("\"c1.x.viscous.c\", \"c1.x.viscous.c\""), "stands twice", "key order[0].order[1]");
    case(&order("\"c1.x.viscous.c\", \"c1.x.linear_stiffness.k\""), "is a viscous damping and", "key order[0].order");
    case("[[order]]\nordr = []\n", "unknown key `ordr`, nearest is `order`", "key order[0].ordr");
    case(&(order(&all) + "gap = \"-1 N s/mm\"\n"), "a gap of -1 N s/mm", "key order[0].gap");
    case(&(order(&all) + "gap = \"1 N\"\n"), "where a viscous damping is expected", "key order[0].gap");
    let circle = order("\"c1.x.viscous.c\", \"c1.x.viscous#2.c\"") + &order("\"c1.x.viscous#2.c\", \"c1.x.viscous.c\"");
    case(&circle, "the order runs in a circle", "line 33, key order[1].order");
    // The first is at least 5, the second at most 3: no point satisfies the order.
    let low = two.replacen("c = { start = \"0.1 N s/mm\", min = \"0 N s/mm\" }", "c = { start = \"6 N s/mm\", min = \"5 N s/mm\" }", 1);
    let low = low.replacen("c = { start = \"0.1 N s/mm\", min = \"0 N s/mm\" }", "c = { start = \"1 N s/mm\", max = \"3 N s/mm\" }", 1);
    let result = read(&(low + &order("\"c1.x.viscous.c\", \"c1.x.viscous#2.c\"")), &dataset);
    let message =
        "c1.x.viscous.c >= 5 N s/mm; c1.x.viscous#2.c >= 0 N s/mm; c1.x.viscous#2.c <= 3 N s/mm; c1.x.viscous.c <= c1.x.viscous#2.c";
    refused(result, message, "line 31, key order[0].order");
    // A gap no bound leaves room for.
    let tight = two.replace("min = \"0 N s/mm\" }", "max = \"1 N s/mm\" }");
    refused(read(&(tight + &order(&all) + "gap = \"2 N s/mm\"\n"), &dataset), "no point satisfies", "key order[0].order");
    let fixed = two.replacen("min = \"0 N s/mm\" }", "fixed = true }", 1) + &order("\"c1.x.viscous.c\", \"c1.x.viscous#2.c\"");
    refused(read(&fixed, &dataset), "unknown free parameter `c1.x.viscous.c`", "key order[0].order[0]");
}

#[test]
fn predictions() {
    let dataset = Folder::one(ONE).dataset();
    let cycle = "[[prediction]]\ncase = \"a\"\nquantity = \"W_D\"\nat = \"c1.x\"\ncontrol = \"force\"\nforce_min = \"1 N\"\nforce_max = \"9 N\"\n\
                 conditions = { frequency = \"1 Hz\" }\n";
    let case = |from: &str, to: &str, message: &str, place: &str| {
        assert!(cycle.contains(from), "{from}");
        refused(read(&format!("{ONE}{}", cycle.replacen(from, to, 1)), &dataset), message, place);
    };
    case("\"W_D\"", "\"W_d\"", "unknown quantity `W_d`, nearest is `W_D`", "line 24, key prediction[0].quantity");
    case("c1.x", "c2.x", "there is no place `c2.x`; the nearest is `c1.x`", "key prediction[0].at");
    case("\"force\"", "\"forse\"", "nearest is `force`", "key prediction[0].control");
    case("9 N", "0.9 N", "crossed", "key prediction[0]");
    case("force_max = \"9 N\"\n", "", "not complete", "key prediction[0]");
    case("force_max = \"9 N\"", "displacement_max = \"9 mm\"", "not a limit under force control", "key prediction[0].displacement_max");
    case("9 N", "9 mm", "where a force is expected", "key prediction[0].force_max");
    case("conditions = { frequency = \"1 Hz\" }\n", "", "required key `frequency` is missing", "line 22, key prediction[0]");
    case("1 Hz", "-1 Hz", "a frequency of -1 Hz", "key prediction[0].conditions.frequency");
    case("case = \"a\"\n", "case = \"a\"\nreference = \"1 N\"\n", "where a moment or energy is expected", "key prediction[0].reference");
    case("case = \"a\"\n", "case = \"a\"\nmode = 1\n", "unknown key `mode`", "key prediction[0].mode");
    let other = |text: &str, message: &str, place: &str| {
        refused(read(&format!("{ONE}[[prediction]]\ncase = \"b\"\n{text}"), &dataset), message, place)
    };
    other("quantity = \"natural_frequency\"\nmode = 0\n", "0 is out of range", "key prediction[0].mode");
    other(
        "quantity = \"receptance\"\nexcite = \"end.y\"\nrespond = \"end.x\"\nfrequency = \"1 Hz\"\n",
        "there is no place `end.y`",
        "key prediction[0].excite",
    );
    other(
        "quantity = \"receptance\"\nexcite = \"end.x\"\nrespond = \"end.x\"\nfrequency = \"0 Hz\"\n",
        "0 Hz is not above 0",
        "key prediction[0].frequency",
    );
}

#[test]
fn fit_and_search() {
    let dataset = Folder::one(ONE).dataset();
    let case = |text: &str, message: &str, place: &str| {
        refused(read(&ONE.replacen("[[body]]", &format!("{text}\n[[body]]"), 1), &dataset), message, &format!("line 4, key {place}"));
    };
    case("fit = { loss = \"hubr\" }", "unknown loss `hubr`, nearest is `huber`", "fit.loss");
    case("fit = { loss = \"huber\", width = 0 }", "a width of 0", "fit.width");
    case("fit = { width = 1.5 }", "squares have no width", "fit");
    case("fit = { starts = 0 }", "0 is out of range", "fit.starts");
    case("fit = { max_iterations = 1.5 }", "found the number 1.5", "fit.max_iterations");
    case("search = { effects = [\"colomb\"] }", "unknown effect `colomb`, nearest is `coulomb`", "search.effects[0]");
    case("search = { places = [\"c2.x\"] }", "there is no place `c2.x`; the nearest is `c1.x`", "search.places[0]");
    case("search = { places = [\"loop-1Hz.forse\"] }", "nearest is `loop-1Hz.force`", "search.places[0]");
    case("search = { max_added = -1 }", "-1 is out of range", "search.max_added");
    case("search = { max_add = 1 }", "unknown key `max_add`, nearest is `max_added`", "search.max_add");
}
