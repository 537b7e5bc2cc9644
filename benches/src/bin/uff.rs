//! Universal files for benches/peers/uff.py.
//!
//! `uff dump FILE` prints the sets as JSON: number, and for a function its abscissa, values, data types and labels. `uff time FILE` reads and decodes
//! the whole file once for each line of its standard input and prints the seconds.

use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use misfit::data::uff::{AnalysisValues, SetContent, UffFile, Values};
use num_complex::Complex64;
use serde_json::{Value, json};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [verb, file] = arguments.as_slice() else { return Err("usage: uff dump|time FILE".into()) };
    let path = Path::new(file);
    if verb == "dump" {
        let file = UffFile::open(path)?;
        let sets = (0..file.sets.len())
            .map(|i| Ok(json!({ "type": file.sets[i].number, "content": dump(file.read(i)?) })))
            .collect::<Result<Vec<Value>, misfit::data::DataError>>()?;
        println!("{}", Value::from(sets));
        return Ok(());
    }
    for line in std::io::stdin().lines() {
        line?;
        let clock = Instant::now();
        let file = UffFile::open(path)?;
        for i in 0..file.sets.len() {
            std::hint::black_box(file.read(i)?);
        }
        println!("{:e}", clock.elapsed().as_secs_f64());
        std::io::stdout().flush()?;
    }
    Ok(())
}

fn pairs(v: &[Complex64]) -> Value {
    json!({ "re": v.iter().map(|h| h.re).collect::<Vec<_>>(), "im": v.iter().map(|h| h.im).collect::<Vec<_>>() })
}

fn dump(content: SetContent) -> Value {
    let rows = |v: &[Vec<Complex64>]| Value::from(v.iter().map(|r| pairs(r)).collect::<Vec<_>>());
    match content {
        SetContent::Function(f) => {
            let h = &f.header;
            let values = match &f.values {
                Values::Real(v) => json!({ "re": v }),
                Values::Complex(v) => pairs(v),
            };
            json!({ "x": f.abscissa, "data": values, "func_type": h.function_type, "rsp_node": h.response.node, "rsp_dir": h.response.direction,
                    "ref_node": h.reference.node, "ref_dir": h.reference.direction, "ord_data_type": h.ordinate_type, "num_pts": h.points,
                    "abscissa_spacing": i32::from(h.even), "ordinate_spec_data_type": h.ordinate.data_type,
                    "orddenom_spec_data_type": h.denominator.data_type, "ordinate_axis_lab": h.ordinate.label,
                    "id1": h.id[0], "findings": f.findings.iter().map(|n| n.text.clone()).collect::<Vec<_>>() })
        }
        SetContent::Header(h) => json!({ "model_name": h.model, "description": h.description, "program": h.program }),
        SetContent::Units(u) => {
            json!({ "units_code": u.code, "length": u.length, "force": u.force, "temp": u.temperature, "temp_offset": u.temperature_offset })
        }
        SetContent::Nodes(n) => {
            json!({ "node_nums": n.iter().map(|n| n.number).collect::<Vec<_>>(), "x": n.iter().map(|n| n.position[0]).collect::<Vec<_>>(),
                    "y": n.iter().map(|n| n.position[1]).collect::<Vec<_>>(), "z": n.iter().map(|n| n.position[2]).collect::<Vec<_>>() })
        }
        SetContent::Trace(t) => json!({ "trace_num": t.number, "n_nodes": t.declared, "color": t.colour, "id": t.name, "nodes": t.nodes }),
        SetContent::Elements(e) => {
            json!({ "nodes": e.iter().map(|e| e.nodes.clone()).collect::<Vec<_>>(), "numbers": e.iter().map(|e| e.number).collect::<Vec<_>>() })
        }
        SetContent::NodalData(d) => {
            json!({ "node_nums": d.nodes, "values": rows(&d.values), "analysis_type": d.analysis_type, "reals": d.reals })
        }
        SetContent::Analysis(a) => match &a.values {
            AnalysisValues::At(nodes, values) => json!({ "node_nums": nodes, "values": rows(values), "frequency": a.reals.get(1) }),
            AnalysisValues::NotRead => json!({}),
        },
        SetContent::Other => json!({}),
    }
}
