//! dataset.toml and study.toml for what was found.

use std::collections::BTreeMap;
use std::path::Path;

use crate::data::inspect::{FoundBackbone, FoundFile, FoundFrf, FoundHistory, FoundItem, FoundModes};
use crate::data::{Control, Role};
use crate::units::{Dimension, parse_unit};

/// The two files, and what the engineer has to look at in them.
pub struct Scaffold {
    pub dataset: String,
    pub study: String,
    pub to_confirm: Vec<String>,
}

/// A string of TOML.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_string()).to_string()
}

fn rounded(x: f64, digits: usize) -> f64 {
    format!("{x:.*e}", digits.saturating_sub(1)).parse().unwrap_or(x)
}

/// Axes in the order in which the nodes of a table of modes get them.
pub const AXES: [&str; 6] = ["x", "y", "z", "theta", "phi", "psi"];

#[derive(Default)]
struct Writer {
    tests: String,
    ids: Vec<String>,
    to_confirm: Vec<String>,
    /// Stiffness and damping (SI) of the loops, with the units to print them in.
    connector: Option<(f64, f64, String, String, &'static str)>,
    loops: bool,
    /// Nodes of the FRFs, mode shapes and histories with their axes.
    nodes: BTreeMap<i64, Vec<&'static str>>,
}

pub fn write(found: &[FoundFile]) -> Option<Scaffold> {
    let mut w = Writer::default();
    for file in found {
        for item in &file.items {
            match item {
                FoundItem::History(h) => w.history(&file.path, h),
                FoundItem::Frf(f) => w.frf(&file.path, f),
                FoundItem::Modes(m) => w.modes(&file.path, m),
                FoundItem::Backbone(b) => w.backbone(&file.path, b),
                FoundItem::Other(_) => {}
            }
        }
    }
    if w.ids.is_empty() {
        return None;
    }
    let dataset = format!("# Written by `misfit new`: confirm every line by eye.\nschema = 1\n{}", w.tests);
    let study = w.study();
    w.to_confirm.sort();
    w.to_confirm.dedup();
    Some(Scaffold { dataset, study, to_confirm: w.to_confirm })
}

impl Writer {
    fn id(&mut self, path: &Path, more: &str) -> String {
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let plain = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '-' };
        let base: String = format!("{stem}{more}").chars().map(plain).collect();
        let taken = |ids: &[String], id: &str| ids.iter().any(|i| i == id);
        let id = (1..).map(|k| if k == 1 { base.clone() } else { format!("{base}-{k}") }).find(|id| !taken(&self.ids, id)).unwrap_or(base);
        self.ids.push(id.clone());
        id
    }

    fn channel(&mut self, id: &str, role: Role, at: Option<&str>, column: &str, unit: Option<&str>, more: &str) -> String {
        let at = at.map_or(String::new(), |a| format!(" at = {},", quoted(a)));
        let known = unit.filter(|u| role.dimensions().is_empty() || role.dimensions().iter().any(|d| parse_unit(u, *d).is_ok()));
        let bare = role.dimensions().iter().any(|d| d.is_dimensionless());
        let unit = match (known, bare) {
            (Some(u), _) => format!(", unit = {}", quoted(u)),
            (None, true) => String::new(),
            (None, false) => {
                self.to_confirm.push(format!("{id}: the unit of `{column}` is not in the file; write it in dataset.toml"));
                ", unit = \"\"".to_string()
            }
        };
        format!(" {{ role = \"{}\",{at} column = {}{unit}{more} }},\n", role.word(), quoted(column))
    }

    fn history(&mut self, path: &Path, h: &FoundHistory) {
        let has = |r: Role| h.columns.iter().any(|c| c.role == Some(r));
        let drives = [Role::Displacement, Role::Force].into_iter().find(|r| has(*r));
        let answers = h.columns.iter().filter_map(|c| c.role).filter(|r| r.has_place() && Some(*r) != drives).count();
        if h.cyclic.is_none() && (drives.is_none() || answers == 0) {
            if h.columns.iter().filter_map(|c| c.role).any(|r| r.has_place()) && !has(Role::Force) {
                return self.undriven(path, h);
            }
            let name = path.display();
            self.to_confirm.push(format!(
                "{name}: a history left out, it has no channel that drives (displacement or force) and one that answers, nor motions alone"
            ));
            return;
        }
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let id = self.id(path, "");
        let turning = h
            .columns
            .iter()
            .any(|c| c.role == Some(Role::Displacement) && c.unit.as_deref().is_some_and(|u| parse_unit(u, Dimension::ANGLE).is_ok()));
        let axis = if turning { "psi" } else { "x" };
        let at = format!("c1.{axis}");
        let mut text = format!(
            "\n[[test]]\nid = {}\nkind = \"{}\"\nfile = {}\n",
            quoted(&id),
            if h.cyclic.is_some() { "cycle" } else { "transient" },
            quoted(&name)
        );
        if let Some(c) = &h.cyclic {
            let remark = if c.recognised { "recognised by its shape" } else { "assumed: confirm it" };
            text += &format!("control = \"{}\"   # {remark}\n", c.control.role().word());
            text += &format!(
                "conditions = {{ frequency = \"{} Hz\" }}\ndiscard_cycles = {}   # start-up, of {} cycles\n",
                rounded(c.frequency, 6),
                c.start_up,
                c.cycles
            );
            if !c.recognised {
                self.to_confirm.push(format!("{id}: the control could not be recognised"));
            }
            self.start(h, axis);
        } else {
            let control = if has(Role::Displacement) { Control::Displacement } else { Control::Force };
            text += &format!("control = \"{}\"   # assumed: confirm it\n", control.role().word());
            self.to_confirm.push(format!("{id}: what drives this history"));
        }
        let (channels, acts) = self.channels(&id, h, &at);
        self.tests += &(text + &channels);
        if acts {
            self.loops = true;
            self.to_confirm.push(format!("{id}: place {at} is where the rig acts"));
        }
    }

    /// The channels of a history with what was found in it; whether some that the file gives no node are `elsewhere`.
    fn channels(&mut self, id: &str, h: &FoundHistory, elsewhere: &str) -> (String, bool) {
        let (mut text, mut any) = ("channels = [\n".to_string(), false);
        for c in &h.columns {
            let Some(role) = c.role.filter(|r| *r == Role::Time || r.has_place()) else {
                text += &format!(" # not used: {}\n", c.column.replace(['\n', '\r'], " "));
                continue;
            };
            if let Some(rate) = c.clock {
                text += &format!(" {{ role = \"time\", rate = \"{rate} Hz\" }},\n");
                continue;
            }
            // The places of a loop are those of the joint it is measured at.
            let node = c.at.filter(|_| h.cyclic.is_none());
            let turned = if node.is_some_and(|n| n.2) { ", scale = -1" } else { "" };
            let at = match node {
                _ if role == Role::Time => None,
                Some((node, axis, _)) => Some(self.node(node, axis)),
                None => {
                    any = true;
                    Some(elsewhere.to_string())
                }
            };
            let line = self.channel(id, role, at.as_deref(), &c.column, c.unit.as_deref(), turned);
            if c.guessed {
                self.to_confirm.push(format!("{id}: that `{}` is the {}; its letter alone says so", c.column, role.word()));
                text += &format!("{}   # by its letter alone: confirm it\n", line.trim_end());
            } else {
                text += &line;
            }
        }
        for n in &h.findings {
            text += &format!(" # finding: {}: {}\n", n.about, n.text).replace('\r', " ");
        }
        (text + "]\n", any)
    }

    /// Motions and nothing that drives them: a decay, or responses to an excitation that was not measured.
    fn undriven(&mut self, path: &Path, h: &FoundHistory) {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let id = self.id(path, "");
        let (what, otherwise) = if h.decays {
            (
                "kind = \"transient\"\ncontrol = \"free\"   # it decays: nothing drives it; confirm it",
                "that nothing drives this record, which decays",
            )
        } else {
            let otherwise = "that the excitation, which is not in the file, is broad: natural frequencies and damping are identified from the responses alone";
            ("kind = \"modal\"\noutput_only = true   # it does not decay: its excitation was not measured; confirm it", otherwise)
        };
        self.to_confirm.push(format!("{id}: {otherwise}"));
        let (channels, placeless) = self.channels(&id, h, "n1.x");
        if placeless {
            let at = self.node(1, "x");
            self.to_confirm.push(format!("{id}: that it is measured at {at}"));
        }
        self.tests += &format!("\n[[test]]\nid = {}\n{what}\nfile = {}\n{channels}", quoted(&id), quoted(&name));
    }

    /// A place of the model at a node of the file.
    fn node(&mut self, node: i64, axis: &'static str) -> String {
        let axes = self.nodes.entry(node).or_default();
        if !axes.contains(&axis) {
            axes.push(axis);
        }
        format!("n{node}.{axis}")
    }

    /// Start values from the first loop: stiffness by its ranges, damping by its area.
    fn start(&mut self, h: &FoundHistory, axis: &'static str) {
        let Some(c) = h.cyclic.as_ref().filter(|_| self.connector.is_none()) else { return };
        let Some(e) = c.settled.energy(None) else { return };
        let amplitude = 0.5 * e.travel.value;
        let k = e.force_range.value / e.travel.value;
        let omega = std::f64::consts::TAU * c.frequency;
        // A loop that runs backwards has a sign swapped, and the damping it shows all the same.
        let damping = (e.dissipated.value.abs() / (std::f64::consts::PI * omega * amplitude * amplitude)).max(1e-6 * k / omega);
        let unit = |role: Role| h.columns.iter().find(|c| c.role == Some(role)).and_then(|c| c.unit.clone()).unwrap_or_default();
        let (force, length) = (unit(Role::Force), unit(Role::Displacement));
        self.connector = Some((k, damping, force, length, axis));
    }

    fn frf(&mut self, path: &Path, f: &FoundFrf) {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let label = |p: Option<(i64, &'static str, bool)>| p.map(|(n, axis, _)| format!("n{n}.{axis}"));
        let more = match (label(f.respond), label(f.excite)) {
            (Some(r), Some(e)) if f.record.is_some() => format!("-{r}-{e}"),
            _ => f.record.as_deref().map_or(String::new(), |r| r.replace('#', "-")),
        };
        let id = self.id(path, &more);
        let mut place = |p: Option<(i64, &'static str, bool)>, what: &str, confirm: &mut Vec<String>| match p {
            Some((node, axis, _)) => self.node(node, axis),
            None => {
                confirm.push(format!("{id}: the place of the {what}"));
                self.nodes.entry(1).or_insert_with(|| vec!["x"]);
                "n1.x".to_string()
            }
        };
        let mut confirm = Vec::new();
        let (excite, respond) = (place(f.excite, "force", &mut confirm), place(f.respond, "response", &mut confirm));
        let quantity = f.quantity.map_or("", |q| q.word());
        if quantity.is_empty() {
            confirm.push(format!("{id}: whether it is an accelerance, mobility or receptance"));
        }
        let record = f.record.as_ref().map_or(String::new(), |r| format!("record = {}\n", quoted(r)));
        let mut text = format!(
            "\n[[test]]\nid = {}\nkind = \"frf\"\nfile = {}\n{record}excite = \"{excite}\"\nrespond = \"{respond}\"\nquantity = \"{quantity}\"\nchannels = [\n",
            quoted(&id),
            quoted(&name)
        );
        for (role, column, unit) in &f.columns {
            let averages = match (role, f.averages) {
                (Role::Coherence, Some(n)) => format!(", averages = {n}"),
                (Role::Coherence, None) => {
                    confirm.push(format!("{id}: the number of averages behind the coherence"));
                    ", averages = 0".into()
                }
                _ => String::new(),
            };
            if *role == Role::Excitation {
                confirm.push(format!("{id}: that `{column}` is the peak force of every line, and no rms"));
            }
            let missing = unit.is_none() && matches!(role, Role::Real | Role::Imag | Role::Amplitude);
            if missing {
                confirm.push(format!("{id}: the unit of `{column}` is not in the file; write it in dataset.toml"));
                text += &format!(" {{ role = \"{}\", column = {}, unit = \"\" }},\n", role.word(), quoted(column));
            } else {
                text += &self.channel(&id, *role, None, column, unit.as_deref(), &averages);
            }
        }
        f.findings.iter().for_each(|n| text += &format!(" # finding: {}\n", n.replace(['\n', '\r'], " ")));
        self.to_confirm.extend(confirm);
        self.tests += &(text + "]\n");
    }

    /// A table of modes. Where no FRF names degrees of freedom, the model gets as many at the nodes of the shapes as there are modes.
    fn modes(&mut self, path: &Path, m: &FoundModes) {
        let id = self.id(path, "-modes");
        let row = |(k, (f, z)): (usize, &(f64, Option<f64>))| {
            let damping = z.map_or(String::new(), |z| format!(", damping = \"{} %\"", rounded(100.0 * z, 6)));
            format!(" {{ mode = {}, frequency = \"{} Hz\"{damping} }},\n", k + 1, rounded(*f, 8))
        };
        let rows: String = m.modes.iter().enumerate().map(row).collect();
        self.tests += &format!("\n[[test]]\nid = {}\nkind = \"modal\"\nrows = [\n{rows}]\n", quoted(&id));
        self.to_confirm
            .push(format!("{id}: whether mode 1 is the first of the structure; the numbers count the file's modes by frequency"));
        let nodes = if m.nodes.is_empty() { &[1][..] } else { &m.nodes[..m.nodes.len().min(m.modes.len())] };
        for axis in AXES.into_iter().take(m.modes.len().div_ceil(nodes.len())) {
            for node in nodes {
                self.node(*node, axis);
            }
        }
    }

    /// A table of natural frequency and damping ratio over amplitude. Its place is no matter of the file.
    fn backbone(&mut self, path: &Path, b: &FoundBackbone) {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let id = self.id(path, "");
        let at = self.node(1, if b.turning { "psi" } else { "x" });
        let mut text = format!(
            "\n[[test]]\nid = {}\nkind = \"backbone\"\nat = \"{at}\"   # assumed: confirm it\nfile = {}\nchannels = [\n",
            quoted(&id),
            quoted(&name)
        );
        for c in &b.columns {
            let line = self.channel(&id, c.role, None, &c.column, c.unit.as_deref(), "");
            if let Some(guess) = c.guess {
                self.to_confirm.push(format!("{id}: that `{}` is the {}, by {guess}", c.column, c.role.word()));
                text += &format!("{}   # by {guess}: confirm it\n", line.trim_end());
            } else {
                text += &line;
            }
        }
        self.to_confirm
            .push(format!("{id}: the place of the amplitude, and that it is the peak of the displacement's first harmonic, no rms"));
        let which = match b.columns.iter().any(|c| c.role == Role::Frequency) {
            true => "that the mode nearest to the frequency of the first row is the one that was measured; else write `mode = 1, 2, ...`",
            false => "the number of the mode: write `mode = 1, 2, ...`",
        };
        self.to_confirm.push(format!("{id}: {which}"));
        self.tests += &(text + "]\n");
    }

    fn study(&mut self) -> String {
        let mut text =
            "# Written by `misfit new`: the model below is a beginning, to be confirmed by eye.\nschema = 1\ndataset = \"data\"\n"
                .to_string();
        if self.ids.len() >= 3 {
            text += "# split = { held_out = [...] }   # keep a test or two for the end\n";
        }
        if self.loops {
            let axis = self.connector.as_ref().map_or("x", |c| c.4);
            text += &format!(
                "\n[[body]]\nname = \"end\"                 # massless, driven\nfree = [\"{axis}\"]\n\n[[connector]]\nname = \"c1\"\nfrom = \"ground\"\nto = \"end\"\n"
            );
            let (k, c, per) = self.connector_values(axis);
            text += &format!(
                "\n[[effect]]\neffect = \"linear_stiffness\"\nat = \"c1.{axis}\"\nk = {{ start = \"{k}\", min = \"0 {}\" }}\n",
                per.0
            );
            text += &format!("\n[[effect]]\neffect = \"viscous\"\nat = \"c1.{axis}\"\nc = {{ start = \"{c}\", min = \"0 {}\" }}\n", per.1);
        }
        if !self.nodes.is_empty() {
            self.to_confirm.push("study.toml: masses, and how the nodes are joined, are placeholders".into());
            let mut before = "ground".to_string();
            for (k, (node, axes)) in self.nodes.iter().enumerate() {
                let free: Vec<String> = axes.iter().map(|a| format!("\"{a}\"")).collect();
                let turning = axes.iter().any(|a| matches!(*a, "theta" | "phi" | "psi"));
                let inertia = if turning { "inertia = \"0.001 kg m2\"   # placeholder\n" } else { "" };
                text += &format!(
                    "\n[[body]]\nname = \"n{node}\"\nmass = \"1 kg\"                 # placeholder\n{inertia}free = [{}]\n",
                    free.join(", ")
                );
                let joint = format!("j{}", k + 1);
                text += &format!(
                    "\n[[connector]]               # placeholder: a chain in the order of the nodes\nname = \"{joint}\"\nfrom = \"{before}\"\nto = \"n{node}\"\n"
                );
                for axis in axes {
                    let about = matches!(*axis, "theta" | "phi" | "psi");
                    let (k, c) = if about { ("N m/rad", "N m s/rad") } else { ("N/mm", "N s/mm") };
                    text += &format!(
                        "\n[[effect]]\neffect = \"linear_stiffness\"\nat = \"{joint}.{axis}\"\nk = {{ start = \"100 {k}\", min = \"0 {k}\" }}\n"
                    );
                    text += &format!(
                        "\n[[effect]]\neffect = \"viscous\"\nat = \"{joint}.{axis}\"\nc = {{ start = \"0.01 {c}\", min = \"0 {c}\" }}\n"
                    );
                }
                before = format!("n{node}");
            }
        }
        text
    }

    /// Stiffness and damping as text in the units of the file, and their units; in SI where a unit is missing.
    fn connector_values(&self, axis: &str) -> (String, String, (String, String)) {
        let about = axis == "psi";
        let (dk, dc) = if about {
            (Dimension::ROTATIONAL_STIFFNESS, Dimension::ROTATIONAL_DAMPING)
        } else {
            (Dimension::STIFFNESS, Dimension::DAMPING)
        };
        let si = if about { ("N m/rad", "N m s/rad") } else { ("N/mm", "N s/mm") };
        let Some((k, c, force, length, _)) = &self.connector else {
            return (format!("1 {}", si.0), format!("0.01 {}", si.1), (si.0.into(), si.1.into()));
        };
        let own = (format!("{force}/{length}"), format!("{force} s/{length}"));
        let units = match (parse_unit(&own.0, dk), parse_unit(&own.1, dc)) {
            (Ok(a), Ok(b)) => Some((a, b)),
            _ => None,
        };
        let fallback = || parse_unit(si.0, dk).ok().zip(parse_unit(si.1, dc).ok());
        match units.or_else(fallback) {
            Some((a, b)) => {
                let text = |si: f64, u: &crate::units::Unit| format!("{} {}", rounded(u.from_si(si), 3), u.symbol);
                (text(*k, &a), text(*c, &b), (a.symbol.clone(), b.symbol.clone()))
            }
            None => (format!("1 {}", si.0), format!("0.01 {}", si.1), (si.0.into(), si.1.into())),
        }
    }
}
