//! The study as a whole.

use std::path::{Path, PathBuf};

use crate::data::toml_strict::{TableView, TomlError, TomlFile};
use crate::data::{DataError, Dataset, schema};
use crate::explain::Explain;
use crate::identify::{Constraints, Prior};
use crate::model::{FreeParam, Instance, Site, System, Target, held};

use super::{
    CoefficientOf, FitSettings, GraphSpec, LeaveOut, OrderSpec, PredictionSpec, SearchSettings, ShiftOf, Split, StudyError, ToleranceSpec,
};
use super::{channels, effects, graph, mechanism, orders, prediction, settings, site, tolerance};

/// A study: model, measurements, and what is to be done with them.
#[derive(Clone, Debug)]
pub struct Study {
    /// study.toml.
    pub file: PathBuf,
    /// The folder it lies in.
    pub folder: PathBuf,
    /// Title for reports; the name of the folder where the file has none.
    pub title: String,
    /// The measurements.
    pub dataset: Dataset,
    /// Where the raw files were taken from, if not from where dataset.toml says (`folder`, or the command line).
    pub data: Option<PathBuf>,
    /// The graph as declared.
    pub graph: GraphSpec,
    /// The model with its effects.
    pub system: System,
    /// Which tests are fitted.
    pub split: Split,
    /// Rows of tables that are compared with nothing.
    pub leave_out: Vec<LeaveOut>,
    /// Modal tests that are compared by their shifts.
    pub shifts: Vec<ShiftOf>,
    /// Monotone orders.
    pub orders: Vec<OrderSpec>,
    /// Options of the fit.
    pub fit: FitSettings,
    /// Options of the search.
    pub search: SearchSettings,
    /// Assumptions the study declares, for the report.
    pub assumptions: Vec<String>,
    /// What `predict` computes.
    pub predictions: Vec<PredictionSpec>,
    /// Tolerance cases that `predict` holds the model against.
    pub tolerance: Option<ToleranceSpec>,
    /// Studies that the program has written of this one, in the order of the way: its fit, what the ladder found. `predict` goes over them; the last is
    /// the answer.
    pub rungs: Vec<PathBuf>,
}

const KEYS: [&str; 22] = [
    "schema",
    "title",
    "dataset",
    "folder",
    "assumptions",
    "split",
    "leave_out",
    "shift",
    "fit",
    "search",
    "body",
    "arc",
    "part",
    "joint",
    "point",
    "connector",
    "load",
    "effect",
    "order",
    "prediction",
    "tolerance",
    "rungs",
];

/// `rungs = ["fitted", "found"]`: folders with a study.toml, or such files.
fn rungs(root: &TableView<'_>, folder: &Path) -> Result<Vec<PathBuf>, StudyError> {
    let Some(value) = root.get("rungs") else { return Ok(vec![]) };
    let one = |name: &str| -> Result<PathBuf, StudyError> {
        let path = folder.join(name);
        let there = path.is_file() || path.join("study.toml").is_file();
        if there {
            Ok(path)
        } else {
            Err(value.refuse(format!("no study at {}", path.display()), "a folder with study.toml, or that file").into())
        }
    };
    value.strings()?.into_iter().map(one).collect()
}

impl Study {
    /// Reads `path` (a folder with study.toml, or that file) and its dataset.
    ///
    /// Raw files are looked for in `data` where it is given (`--data`), else in the `folder` of study.toml, else where dataset.toml says.
    pub fn load(path: &Path, data: Option<&Path>) -> Result<Study, StudyError> {
        let file = if path.is_dir() { path.join("study.toml") } else { path.to_path_buf() };
        let toml = TomlFile::read(&file, "study")?;
        // A misspelt `dataset` is to be named as such, not as missing.
        toml.root().only(&KEYS)?;
        let (dataset, data) = dataset(&toml, data)?;
        let mut study = Study::from_toml(&toml, dataset)?;
        study.data = data;
        Ok(study)
    }

    /// As [`Study::load`], from a study.toml already parsed and its dataset already read.
    pub fn from_toml(toml: &TomlFile, dataset: Dataset) -> Result<Study, StudyError> {
        let root = toml.root();
        root.only(&KEYS)?;
        schema(&root)?;
        let folder = folder_of(toml.path());
        let (graph, mut model) = graph::read(&root)?;
        mechanism::supported(&mut model, &dataset)?;
        channels::check(&dataset, &model)?;
        let split = settings::split(&root, &dataset)?;
        let mut instances = effects::read(&root, &model, &dataset)?;
        let free_masses = effects::masses(&graph, &model, &instances);
        instances.extend(free_masses);
        held(&model, &instances).map_err(|(dof, e)| {
            let table = graph::table_of(&root, &graph, &model.bodies[model.dofs[dof].body].name);
            table.unwrap_or_else(|| root.clone()).refuse(e.to_string(), e.accepted())
        })?;
        mechanism::against(&model, &dataset)?;
        let system = System { model, instances };
        system.check()?;
        let orders = orders::read(&root, &system, &dataset)?;
        let text = |key: &str| root.optional(key, |v| v.string()).map(|s| s.map(str::to_string));
        let named = folder.canonicalize().ok().and_then(|f| f.file_name().map(|n| n.to_string_lossy().into_owned()));
        let study = Study {
            title: text("title")?.or(named).unwrap_or_else(|| "study".into()),
            split,
            orders,
            leave_out: settings::leave_out(&root, &dataset)?,
            shifts: settings::shifts(&root, &dataset)?,
            fit: settings::fit(&root)?,
            search: settings::search(&root, &system.model, &dataset)?,
            assumptions: root.optional("assumptions", |v| v.strings())?.unwrap_or_default().into_iter().map(str::to_string).collect(),
            predictions: prediction::read(&root, &system, &dataset)?,
            tolerance: tolerance::read(&root, &system, &dataset, &folder)?,
            rungs: rungs(&root, &folder)?,
            file: toml.path().to_path_buf(),
            folder,
            dataset,
            data: None,
            graph,
            system,
        };
        study.constraints(&study.system, &study.system.free())?;
        Ok(study)
    }

    /// Bounds and orders of the free parameters of `system` (the study's own, or one with effects added and removed), in the variables
    /// of the fit, checked to have a point that satisfies them all.
    pub fn constraints(&self, system: &System, free: &[FreeParam]) -> Result<Constraints, StudyError> {
        Ok(orders::constraints(&self.orders, system, free, &self.dataset)?)
    }

    /// Priors of the free parameters of `system`.
    pub fn priors(&self, system: &System, free: &[FreeParam]) -> Vec<Prior> {
        orders::priors(system, free)
    }

    /// Where `at` of an effect is, with several places separated by commas (the form of [`Instance::at`]).
    pub fn site(&self, effect: &str, at: &str) -> Result<Site, StudyError> {
        let effect = crate::effect::find(effect).map_err(|e| crate::model::ModelError::invalid(effect, e.to_string(), e.accepted()))?;
        let entries: Vec<&str> = at.split(',').map(str::trim).collect();
        Ok(site::resolve(&self.system.model.finder(), &self.dataset, effect, &entries).map_err(|(_, e)| e)?)
    }

    /// A new effect for this study: `values` by parameter name [SI]; those not named start at their default (strength: its null value).
    /// Strengths and shapes are free, settings fixed.
    pub fn instance(&self, effect: &str, at: &str, values: &[(&str, f64)], of: Option<&CoefficientOf>) -> Result<Instance, StudyError> {
        use crate::effect::{Effect, find};
        use crate::model::ModelError;
        let site = self.site(effect, at)?;
        let law = find(effect).map_err(|e| ModelError::invalid(effect, e.to_string(), e.accepted()))?;
        if let Effect::Formula(_) = law {
            let accepted = "an [[effect]] in study.toml with its expression and parameters";
            return Err(ModelError::invalid(effect, "a formula has no law of its own: it stands in study.toml", accepted).into());
        }
        let target = match (law, of) {
            (Effect::Coefficient(_), Some(of)) => {
                let sites: Vec<_> = self.system.instances.iter().map(|i| (i.effect, &i.site)).collect();
                let (instances, param) = effects::target_of(&self.system.model, &sites, &site, of.of.as_deref())?;
                let Some(unit) = effects::condition(&self.dataset, &of.condition, effect)? else {
                    let stated = effects::stated(&self.dataset).into_iter().map(str::to_string);
                    return Err(ModelError::no_such("condition", &of.condition, stated).into());
                };
                Some(Target { instances, param, condition: of.condition.clone(), reference: of.reference, unit })
            }
            (Effect::Coefficient(_), None) => {
                let message = format!("`{effect}` needs a condition and its reference");
                return Err(ModelError::invalid(effect, message, "condition = \"i\", reference = \"0.3 mm\"").into());
            }
            _ => None,
        };
        let at = at.split(',').map(str::trim).collect::<Vec<_>>().join(",");
        let mut instance = Instance { target, ..Instance::with_values(law, at, site, values)? };
        instance.has_company(&self.system.model, &self.system.instances)?;
        for p in 0..instance.params.len() {
            let unit = super::unit_of(&self.system, &self.dataset, &instance, p);
            instance.params[p].unit = (unit.symbol, unit.factor);
        }
        Ok(instance)
    }
}

/// The folder a file lies in; `.` for a bare file name.
pub(super) fn folder_of(file: &Path) -> PathBuf {
    file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_path_buf()
}

/// Reads the dataset a study names, and says where its raw files were looked for.
fn dataset(toml: &TomlFile, data: Option<&Path>) -> Result<(Dataset, Option<PathBuf>), StudyError> {
    let root = toml.root();
    let beside = folder_of(toml.path());
    let value = root.require("dataset", "the folder with dataset.toml, such as \"data\"")?;
    let path = beside.join(value.string()?);
    if !Dataset::file_of(&path).exists() {
        return Err(value.refuse(format!("no dataset.toml at {}", path.display()), "a folder with dataset.toml, or that file").into());
    }
    let folder = root.optional("folder", |v| v.string())?.map(|f| beside.join(f));
    let raw = data.map(Path::to_path_buf).or(folder);
    let own = data.is_none();
    let dataset = Dataset::load(&path, raw.as_deref()).map_err(|e| explain_folder(&root, own, e))?;
    Ok((dataset, raw))
}

/// A file that is missing in the `folder` of study.toml is an error of that key.
fn explain_folder(root: &TableView<'_>, own: bool, e: DataError) -> StudyError {
    match (&e, root.get("folder")) {
        (DataError::MissingFile { test, tried, .. }, Some(value)) if own => {
            let problem: TomlError = value.refuse(
                format!("test `{test}`: the file {} is not there", tried.display()),
                "the folder that holds the raw files, relative to study.toml (or --data DIR)",
            );
            problem.into()
        }
        _ => e.into(),
    }
}
