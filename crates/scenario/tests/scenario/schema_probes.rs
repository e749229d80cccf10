//! Documents at, inside and outside every limit that a published schema states.

use serde_json::Value as Schema;
use toml::{Table, Value};

/// A document, and whether it fits by what the schema says of the one key that was tried.
#[derive(Debug, Clone)]
pub struct Probe {
    /// The key.
    pub key: String,
    /// The document.
    pub document: Table,
    /// Whether it fits.
    pub fits: bool,
}

#[derive(Debug, Clone)]
enum Step {
    Key(String),
    Index(usize),
}

/// A value at a place.
#[derive(Debug, Clone)]
struct Trial {
    steps: Vec<Step>,
    /// None: the key is taken away.
    value: Option<Value>,
    fits: bool,
    /// Not together with others: a former name may stand beside its present one.
    alone: bool,
}

/// One probe for every limit, choice, length, type and key, and documents of several numbers at once.
pub fn probes(schema: &Schema) -> Vec<Probe> {
    let root = Root(schema);
    let mut trials = Vec::new();
    root.visit(schema, &mut Vec::new(), &mut trials);
    let mut probes: Vec<Probe> = trials
        .iter()
        .map(|trial| root.document(std::slice::from_ref(trial)))
        .collect();
    let numbers: Vec<&Trial> = trials
        .iter()
        .filter(|trial| matches!(trial.value, Some(Value::Float(_))) && !trial.alone)
        .collect();
    for round in 0..SEVERAL {
        let picked: Vec<Trial> = (0..4)
            .map(|k| numbers[scattered(round, k) % numbers.len()].clone())
            .filter(|trial| trial.fits || round % 3 == 0)
            .collect();
        // A later value takes the place of an earlier one.
        let is_last = |at: usize| {
            let key = key(&picked[at].steps);
            !picked[at + 1..]
                .iter()
                .any(|later| self::key(&later.steps) == key)
        };
        let mut probe = root.document(&picked);
        probe.fits = (0..picked.len()).all(|at| picked[at].fits || !is_last(at));
        probes.push(probe);
    }
    probes
}

/// Documents of several numbers.
const SEVERAL: usize = 600;

/// A number that looks random and is always the same.
fn scattered(round: usize, k: usize) -> usize {
    let mut bits = ((round as u64) << 8 | k as u64).wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    usize::try_from((bits ^ (bits >> 31)) >> 16).expect("48 bits")
}

fn key(steps: &[Step]) -> String {
    // Names with other characters than those of bare keys stand in quotes.
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let quoted = |key: &str| {
        if key.chars().all(is_bare) {
            key.to_owned()
        } else {
            format!("\"{key}\"")
        }
    };
    steps.iter().fold(String::new(), |text, step| match step {
        Step::Key(key) if text.is_empty() => quoted(key),
        Step::Key(key) => format!("{text}.{}", quoted(key)),
        Step::Index(index) => format!("{text}[{index}]"),
    })
}

struct Root<'s>(&'s Schema);

impl Root<'_> {
    /// A schema without its references.
    fn plain<'a>(&'a self, mut here: &'a Schema) -> &'a Schema {
        loop {
            here = if let Some(reference) = here["$ref"].as_str() {
                let pointer = reference.trim_start_matches('#');
                self.0.pointer(pointer).expect("references are defined")
            } else if let Some([only]) = here["allOf"].as_array().map(Vec::as_slice) {
                only
            } else {
                return here;
            };
        }
    }

    /// A small value that fits.
    fn sample(&self, here: &Schema) -> Value {
        let here = self.plain(here);
        if let Some(number) = number_of(here) {
            return self.sample(number);
        }
        if let Some(choice) = texts(here).first() {
            return Value::String(choice.clone());
        }
        match here["type"].as_str() {
            Some("boolean") => Value::Boolean(false),
            Some("number") => Value::Float(middle(here)),
            Some("integer") => Value::Integer(here["minimum"].as_i64().unwrap_or(0)),
            Some("array") => {
                let count = length(here, "minItems").unwrap_or(0);
                let items = (0..count).map(|index| self.sample(item(here, index)));
                Value::Array(items.collect())
            }
            Some("object") => {
                let keys = here["required"].as_array().into_iter().flatten();
                let keys = keys.filter_map(Schema::as_str);
                let entries =
                    keys.map(|key| (key.to_owned(), self.sample(&here["properties"][key])));
                Value::Table(entries.collect())
            }
            _ => Value::String("a".to_owned()),
        }
    }

    fn document(&self, trials: &[Trial]) -> Probe {
        let mut document = self.sample(self.0);
        for trial in trials {
            self.put(self.0, &mut document, &trial.steps, trial.value.as_ref());
        }
        let Value::Table(document) = document else {
            panic!("a file is a table");
        };
        Probe {
            key: trials
                .iter()
                .map(|trial| key(&trial.steps))
                .collect::<Vec<_>>()
                .join(", "),
            document,
            fits: trials.iter().all(|trial| trial.fits),
        }
    }

    fn put(&self, here: &Schema, into: &mut Value, steps: &[Step], value: Option<&Value>) {
        let here = self.plain(here);
        match (steps, into) {
            ([Step::Key(key)], Value::Table(table)) if value.is_none() => {
                table.remove(key);
            }
            ([], into) => *into = value.expect("only keys are taken away").clone(),
            ([Step::Key(key), rest @ ..], Value::Table(table)) => {
                let inner = here["properties"].get(key);
                let inner = inner.unwrap_or(&here["additionalProperties"]);
                let place = table
                    .entry(key.clone())
                    .or_insert_with(|| self.sample(inner));
                self.put(inner, place, rest, value);
            }
            ([Step::Index(index), rest @ ..], Value::Array(list)) => {
                while list.len() <= *index {
                    list.push(self.sample(item(here, list.len())));
                }
                self.put(item(here, *index), &mut list[*index], rest, value);
            }
            (steps, into) => panic!("{} has no {}", into, key(steps)),
        }
    }

    fn visit(&self, here: &Schema, steps: &mut Vec<Step>, trials: &mut Vec<Trial>) {
        let here = self.plain(here);
        let mut add = |value: Value, fits: bool| {
            trials.push(Trial {
                steps: steps.clone(),
                value: Some(value),
                fits,
                alone: false,
            });
        };
        if here.as_bool() == Some(true) {
            return;
        }
        let choices = texts(here);
        if let Some(number) = number_of(here) {
            for choice in choices {
                add(choice.into(), true);
            }
            add("no such word".into(), false);
            self.visit(number, steps, trials);
            return;
        }
        if !choices.is_empty() {
            add(Value::Integer(1), false);
            if here["anyOf"].is_null() {
                add("no such choice".into(), false);
            }
            for choice in choices {
                add(choice.into(), true);
            }
            return;
        }
        match here["type"].as_str() {
            Some("boolean") => {
                add(true.into(), true);
                add(1.into(), false);
            }
            Some("number") => {
                let (least, above) = match here["exclusiveMinimum"].as_f64() {
                    Some(least) => (least, true),
                    None => (
                        here["minimum"].as_f64().expect("numbers have a minimum"),
                        false,
                    ),
                };
                let most = here["maximum"].as_f64().expect("numbers have a maximum");
                for (number, fits) in [
                    (least, !above),
                    (least.next_up(), true),
                    (least.next_down(), false),
                    (middle(here), true),
                    (most, true),
                    (most.next_down(), true),
                    (most.next_up(), false),
                    (most * 1e6 + 1.0, false),
                ] {
                    add(number.into(), fits);
                }
                add("1".into(), false);
            }
            Some("integer") => {
                let least = here["minimum"].as_i64().expect("numbers have a minimum");
                let most = here["maximum"].as_i64().expect("numbers have a maximum");
                let listed = here["enum"].as_array();
                add(least.into(), true);
                add(most.into(), true);
                add((least - 1).into(), false);
                if let Some(above) = most.checked_add(1) {
                    add(above.into(), false);
                }
                for each in listed.into_iter().flatten() {
                    add(each.as_i64().expect("a whole number").into(), true);
                }
                add(Value::Float(least as f64 + 0.5), false);
                add("1".into(), false);
            }
            Some("array") => self.visit_list(here, steps, trials),
            Some("object") => self.visit_table(here, steps, trials),
            Some("string") => {
                add(1.into(), false);
                add("a".into(), true);
                if here["pattern"].is_string() {
                    for (name, fits) in [("A_1", true), ("", false), ("a b", false), ("a/b", false)]
                    {
                        add(name.into(), fits);
                    }
                    let longest = length(here, "maxLength").expect("names have an end");
                    add("a".repeat(longest).into(), true);
                    add("a".repeat(longest + 1).into(), false);
                }
            }
            other => panic!("{}: {other:?}", key(steps)),
        }
    }

    fn visit_list(&self, here: &Schema, steps: &mut Vec<Step>, trials: &mut Vec<Trial>) {
        let least = length(here, "minItems").unwrap_or(0);
        let list = |count: usize| -> Value {
            let items = (0..count).map(|index| self.sample(item(here, index)));
            Value::Array(items.collect())
        };
        let mut add = |count: usize, fits: bool| {
            trials.push(Trial {
                steps: steps.clone(),
                value: Some(list(count)),
                fits,
                alone: false,
            });
        };
        add(least, true);
        if least > 0 {
            add(least - 1, false);
        }
        let places = if let Some(most) = length(here, "maxItems") {
            add(most + 1, false);
            most
        } else {
            add(least + 2, true);
            1
        };
        for index in 0..places {
            steps.push(Step::Index(index));
            self.visit(item(here, index), steps, trials);
            steps.pop();
        }
    }

    fn visit_table(&self, here: &Schema, steps: &mut Vec<Step>, trials: &mut Vec<Trial>) {
        let mut at = |name: &str, value: Option<Value>, fits: bool| {
            let mut steps = steps.clone();
            steps.push(Step::Key(name.to_owned()));
            trials.push(Trial {
                steps,
                value,
                fits,
                alone: false,
            });
        };
        if here["additionalProperties"] == false {
            at("no_such_key", Some(1.into()), false);
        } else if here["propertyNames"].is_object() {
            let sample = self.sample(&here["additionalProperties"]);
            at("no_such_key", Some(sample), false);
        }
        for name in here["required"].as_array().into_iter().flatten() {
            at(name.as_str().expect("a name"), None, false);
        }
        if !steps.is_empty() {
            trials.push(Trial {
                steps: steps.clone(),
                value: Some(1.into()),
                fits: false,
                alone: false,
            });
        }
        for (name, inner) in here["properties"].as_object().into_iter().flatten() {
            steps.push(Step::Key(name.clone()));
            let first = trials.len();
            self.visit(inner, steps, trials);
            if inner["deprecated"] == true {
                trials[first..]
                    .iter_mut()
                    .for_each(|trial| trial.alone = true);
            }
            steps.pop();
        }
        for name in texts(&here["propertyNames"]) {
            steps.push(Step::Key(name));
            self.visit(&here["additionalProperties"], steps, trials);
            steps.pop();
        }
    }
}

fn length(list: &Schema, limit: &str) -> Option<usize> {
    let length = list[limit].as_u64()?;
    Some(usize::try_from(length).expect("lists are short"))
}

/// What a list's item is.
fn item(list: &Schema, index: usize) -> &Schema {
    match &list["items"] {
        Schema::Array(items) => &items[index.min(items.len() - 1)],
        item => item,
    }
}

/// Texts that a schema lists.
fn texts(here: &Schema) -> Vec<String> {
    let listed = |value: &Schema| -> Vec<String> {
        let values = value["enum"].as_array().into_iter().flatten();
        let values = values.chain(value.get("const"));
        values
            .filter_map(|each| each.as_str().map(str::to_owned))
            .collect()
    };
    let choices = ["oneOf", "anyOf"]
        .iter()
        .filter_map(|key| here[*key].as_array());
    let mut texts = listed(here);
    texts.extend(choices.flatten().flat_map(listed));
    texts
}

/// The number that a value may be instead of a word.
fn number_of(here: &Schema) -> Option<&Schema> {
    let choices = here["anyOf"].as_array()?;
    choices.iter().find(|each| each["type"] == "number")
}

fn middle(here: &Schema) -> f64 {
    let least = here["minimum"]
        .as_f64()
        .or(here["exclusiveMinimum"].as_f64());
    let most = here["maximum"].as_f64();
    f64::midpoint(least.unwrap_or(-1.0), most.unwrap_or(1.0))
}
