//! The JSON schema of scenes, made from the list of keys.

use super::keys::{Key, Kind, LARGEST_COUNT, Range, of_table};
use serde_json::{Map, Value, json};

/// The schema (draft 2020-12) as text, with a description of every key. The text ends with a line break.
pub fn schema() -> String {
    let mut all = table("");
    all["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    all["title"] = json!("demhybrid scene");
    format!("{all:#}\n")
}

/// The schema of one table of the scene; `""` is the top of the scene.
fn table(path: &str) -> Value {
    let properties: Map<String, Value> =
        of_table(path).map(|key| (key.name().to_owned(), property(key))).collect();
    let required: Vec<_> = of_table(path).filter(|key| key.required).map(Key::name).collect();
    json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
}

fn property(key: &Key) -> Value {
    let mut found = match key.kind {
        Kind::Number(range) => number(range),
        Kind::Vector { .. } => {
            json!({ "type": "array", "items": number(Range::Finite), "minItems": 3, "maxItems": 3 })
        }
        Kind::Numbers(count) => {
            json!({ "type": "array", "items": number(Range::Finite), "minItems": count, "maxItems": count })
        }
        Kind::Pairs => {
            let pair = property(&Key { kind: Kind::Numbers(2), example: "", ..*key });
            json!({ "type": "array", "items": pair, "minItems": 1 })
        }
        Kind::NumberOrTable(range) => json!({ "anyOf": [number(range), table(key.path)] }),
        Kind::Count => json!({ "type": "integer", "minimum": 1, "maximum": LARGEST_COUNT }),
        Kind::Seed => json!({ "type": "integer", "minimum": 0, "maximum": u64::MAX }),
        Kind::Switch => json!({ "type": "boolean" }),
        Kind::Text => json!({ "type": "string", "minLength": 1 }),
        Kind::Word(words) => json!({ "enum": words }),
        Kind::WordOrNumber(words, range) => json!({ "anyOf": [{ "enum": words }, number(range)] }),
        Kind::Table => table(key.path),
        Kind::Tables => json!({ "type": "array", "items": table(key.path) }),
    };
    found["description"] = json!(key.meaning);
    // Examples are TOML values. A table needs none, since the schema describes its keys. Infinite numbers are
    // left out: JSON has none.
    let example = format!("x = {}", key.example).parse::<toml::Table>().ok();
    if let Some(example) = example.and_then(|mut table| table.remove("x")).filter(|value| !value.is_table()) {
        let finite = |value: &toml::Value| value.as_float().is_none_or(f64::is_finite);
        let shown = match &example {
            toml::Value::Array(list) => list.iter().all(finite),
            other => finite(other),
        };
        if let (true, Ok(value)) = (shown, serde_json::to_value(example)) {
            found["examples"] = json!([value]);
        }
    }
    found
}

fn number(range: Range) -> Value {
    match range {
        Range::Finite => json!({ "type": "number" }),
        Range::Positive | Range::PositiveOrInfinite => json!({ "type": "number", "exclusiveMinimum": 0 }),
        Range::NotNegative => json!({ "type": "number", "minimum": 0 }),
        Range::PartOf => json!({ "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1 }),
        Range::Share => json!({ "type": "number", "minimum": 0, "maximum": 1 }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_schema_knows_types_ranges_and_what_must_be_there() {
        let all: Value = serde_json::from_str(&schema()).unwrap();
        assert_eq!(all["required"], json!(["t_end", "particles", "contact"]));
        let contact = &all["properties"]["contact"];
        assert_eq!(contact["additionalProperties"], json!(false));
        let restitution = &contact["properties"]["restitution"];
        assert_eq!((&restitution["minimum"], &restitution["maximum"]), (&json!(0), &json!(1)));
        assert_eq!(restitution["description"], json!("the coefficient of restitution (1 = elastic)"));
        assert_eq!(restitution["examples"], json!([0.4]));
        assert_eq!(all["properties"]["solver"]["properties"]["method"]["enum"][0], json!("auto"));
        let normal = &all["properties"]["container"]["properties"]["wall"]["items"]["properties"]["normal"];
        assert_eq!(normal["minItems"], json!(3));
    }
}
