//! `misfit add`: writes an effect into study.toml and refits.
//!
//! The refit comes first, in memory: the file is touched only when it works.

use serde_json::json;

use crate::diagnose;
use crate::diagnose::results::EffectAt;
use crate::diagnose::results::SplitName;
use crate::work::{self, Failure, Wish};

use super::session::{Common, Session, pair};
use super::{Outcome, fit, report, text};

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Name of the effect; `misfit effects` lists them
    effect: String,
    /// Place such as c1.x, c1-7.x, or channel such as loop-1Hz.force
    #[arg(long, value_name = "PLACE")]
    at: String,
    /// Start of a parameter, such as v0="1 mm/s"; without it a strength starts at none and a shape where the tests move
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair)]
    set: Vec<(String, String)>,
    /// For a coefficient: the parameter it scales, such as viscous.c
    #[arg(long, value_name = "EFFECT.PARAMETER", requires = "condition")]
    of: Option<String>,
    /// For a coefficient: the condition
    #[arg(long, value_name = "NAME", requires = "reference")]
    condition: Option<String>,
    /// For a coefficient: value of the condition at which the factor is 1, such as "0.3 mm"
    #[arg(long, value_name = "VALUE", requires = "condition")]
    reference: Option<String>,
    /// Leaves study.toml as it is: the study with the effect stands in the folder of the run alone
    #[arg(long)]
    keep_study: bool,
    #[command(flatten)]
    sealed: text::Sealed,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let case = session.case(&study)?;
    session.progress.say("fit before");
    let (case, before_fit, before) = diagnose::fit(&case, &SplitName::ALL, &session.monitor())?;
    let wish = Wish {
        effect: args.effect.clone(),
        at: args.at.clone(),
        set: args.set.clone(),
        of: args.of.clone(),
        condition: args.condition.clone(),
        reference: args.reference.clone(),
    };
    let done =
        work::refit(&study, &case, &before_fit.system, &wish, &SplitName::ALL, &session.monitor(), &|step| session.progress.say(step));
    session.progress.end();
    let Some(done) = done? else {
        return Err(Failure::new("identify", "", "interrupted before the refit was done; study.toml is as it was", "more time"));
    };
    let (instance, after) = (&done.instance, &done.result);
    // The run is complete before the engineer's file changes: had it no room on the disk, nothing would have happened.
    let folder = session.folder(&study, "add")?;
    folder.study(&study, &done.fitted.system)?;
    folder.residuals(&after.tests)?;
    session.show(&after.tests);
    let added = EffectAt::of(&done.fitted.system, instance);
    let value = fit::json(&json!({ "before": fit::plain(&before)?, "after": fit::plain(after)?, "added": fit::plain(&added)? }), &folder)?;
    report::write(&folder, &study, &done.fitted.system, Some(after), None, None)?;
    folder.result(&value)?;
    let file = if args.keep_study {
        folder.path.join("study.toml")
    } else {
        study.write_effect(instance)?;
        study.file.clone()
    };
    let (shown, code) = (args.common.study.display().to_string(), fit::code(&after.termination));
    let (before, after) = (text::tests(&before.tests, args.sealed), text::fit(after, &shown, args.sealed));
    let text = format!("before\n{before}\nafter: {added} is in {}\n{after}", file.display());
    Ok(Outcome { json: value, text, code })
}
