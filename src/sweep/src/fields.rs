//! Values of the keys of a scene file, named by paths such as `contact[1].gap`.

use tiprub_format::{FIELDS, SceneField};
use tiprub_shell::{Failure, Result, native::similar};
use toml::{Table, Value};

/// One name of a path, with the index (from 1) or the name of an entry in brackets.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Step<'a> {
    key: &'a str,
    entry: Option<&'a str>,
}

/// Splits a path at its points.
fn steps(path: &str) -> Result<Vec<Step<'_>>> {
    let parsed: Option<Vec<Step<'_>>> = path.split('.').map(parsed_step).collect();
    parsed.ok_or_else(|| {
        let remedy = "Give a path such as contact[1].gap or structure[blade].speed";
        Failure::new(format!("field `{path}`"), "is not the path of a key", remedy)
    })
}

fn parsed_step(part: &str) -> Option<Step<'_>> {
    let (key, entry) = match part.split_once('[') {
        Some((key, rest)) => (key, Some(rest.strip_suffix(']')?)),
        None => (part, None),
    };
    (!key.is_empty() && entry != Some("")).then_some(Step { key, entry })
}

/// Sets the value at a path of a scene. Tables that are missing are created.
///
/// # Errors
/// The scene file has no such key, with similar keys; or the scene has no such entry.
pub fn set(scene: &mut Table, path: &str, value: Value) -> Result<()> {
    let steps = steps(path)?;
    let field = find_key(path, &steps)?;
    let value = match value {
        // A range contains real numbers, but some keys need whole numbers.
        #[expect(clippy::cast_possible_truncation, reason = "whole, and far below 2^63")]
        Value::Float(number) if field.value.starts_with("whole") && number.fract() == 0.0 && number.abs() < 1e15 => {
            Value::Integer(number as i64)
        }
        other => other,
    };
    let (last, tables) = steps.split_last().expect("a path has at least one step");
    let mut table = scene;
    for step in tables {
        let below = table.entry(step.key).or_insert_with(|| Value::Table(Table::new()));
        table = match (entry(path, step, below)?, step.key) {
            (Value::Table(table), _) => table,
            (_, key) => return Err(Failure::new(format!("field `{path}`"), format!("`{key}` is not a table"), "")),
        };
    }
    match last.entry {
        None => {
            table.insert(last.key.to_owned(), value);
        }
        Some(_) => {
            let problem = format!("the scene has no list `{}`", last.key);
            let missing = || Failure::new(format!("field `{path}`"), problem, "Set the whole list, without brackets");
            *entry(path, last, table.get_mut(last.key).ok_or_else(missing)?)? = value;
        }
    }
    Ok(())
}

/// Returns the key of a path without numbers and names of entries, as the reference of scene files lists it.
///
/// # Errors
/// The text is not a path.
pub(crate) fn key(path: &str) -> Result<String> {
    Ok(join_keys(&steps(path)?))
}

fn join_keys(steps: &[Step]) -> String {
    steps.iter().map(|step| step.key).collect::<Vec<_>>().join(".")
}

/// Returns the unique path of a key of the scene, in which a number (from 1) selects every entry of a list.
///
/// # Errors
/// The scene has no such entry.
pub(crate) fn place(scene: &Table, path: &str) -> Result<String> {
    let (mut scene, mut place) = (Value::Table(scene.clone()), String::new());
    let mut table = &mut scene;
    for step in steps(path)? {
        let missing =
            || Failure::new(format!("field `{path}`"), "is not in the scene", "Correct the path of the field");
        let below = table.get_mut(step.key).ok_or_else(missing)?;
        let separator = if place.is_empty() { "" } else { "." };
        place.push_str(&format!("{separator}{}", step.key));
        let Value::Array(entries) = &*below else {
            table = below;
            continue;
        };
        let selected = step.entry.is_some() || entries.len() == 1 && entries[0].is_table();
        if !selected {
            return Ok(place);
        }
        let position = position(entries, step.entry).unwrap_or_default();
        place.push_str(&format!("[{}]", position + 1));
        table = entry(path, &step, below)?;
    }
    Ok(place)
}

/// Returns whether two places from [`place`] are the same key, or one contains the other.
pub(crate) fn overlap(one: &str, two: &str) -> bool {
    let contains = |whole: &str, part: &str| {
        part.strip_prefix(whole).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    contains(one, two) || contains(two, one)
}

/// Returns the index of the entry of a list that is selected by a number (from 1) or by a name. Without a selection, the list must have one entry.
fn position(entries: &[Value], selected: Option<&str>) -> Option<usize> {
    let named = |entry: &Value| entry.get("name").and_then(Value::as_str).map(str::to_owned);
    match selected {
        None => (entries.len() == 1).then_some(0),
        Some(text) => match text.parse::<usize>() {
            Ok(number) => number.checked_sub(1).filter(|index| *index < entries.len()),
            Err(_) => entries.iter().position(|entry| named(entry).as_deref() == Some(text)),
        },
    }
}

/// Returns the key of scene files that a path names, or an error with similar keys.
fn find_key(path: &str, steps: &[Step]) -> Result<&'static SceneField> {
    let name = join_keys(steps);
    if let Some(field) = FIELDS.iter().find(|field| field.path == name) {
        return Ok(field);
    }
    let known: Vec<&str> = FIELDS.iter().map(|field| field.path).collect();
    let remedy = similar(&name, &known, "keys of scene files");
    Err(Failure::usage(format!("field `{path}`"), "scene files have no such key", remedy))
}

/// Returns the entry of a repeated table or a list, or the value itself.
fn entry<'a>(path: &str, step: &Step, value: &'a mut Value) -> Result<&'a mut Value> {
    let Value::Array(entries) = value else {
        return match step.entry {
            None => Ok(value),
            Some(_) => Err(Failure::usage(
                format!("field `{path}`"),
                format!("`{}` is not repeated in the scene", step.key),
                format!("Write `{}` without brackets", step.key),
            )),
        };
    };
    let named = |entry: &Value| entry.get("name").and_then(Value::as_str).map(str::to_owned);
    let position = position(entries, step.entry);
    let count = entries.len();
    let names: Vec<String> = entries.iter().filter_map(named).collect();
    position.and_then(|index| entries.get_mut(index)).ok_or_else(|| {
        let names = if names.is_empty() { String::new() } else { format!(" or a name of {}", names.join(", ")) };
        Failure::usage(
            format!("field `{path}`"),
            match step.entry {
                Some(entry) => format!("the scene has no entry `{}[{entry}]`", step.key),
                None => format!("the scene has {count} entries `{}`, and the path selects none of them", step.key),
            },
            match count {
                0 => format!("Add an entry `{}` to the scene, or correct the path", step.key),
                1 => format!("Write `{}` without brackets, or `{}[1]`", step.key, step.key),
                _ => format!("Write `{}[...]` with a number from 1 to {count}{names}", step.key),
            },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "name = \"a\"\n[[structure]]\nname = \"front\"\nspeed = 1.0\n[[structure]]\nname = \"rear\"\n\
                         [[contact]]\nmaster = \"front\"\nsector_gaps = [1.0, 2.0]\n";

    fn changed(path: &str, value: Value) -> Result<Table> {
        let mut scene: Table = toml::from_str(SCENE).unwrap();
        set(&mut scene, path, value)?;
        Ok(scene)
    }

    #[test]
    fn values_are_set_by_number_and_by_name() {
        for (path, found) in [
            ("structure[2].speed", "/structure/1/speed"),
            ("structure[rear].speed", "/structure/1/speed"),
            ("contact.gap", "/contact/0/gap"),
            ("contact[1].sector_gaps[2]", "/contact/0/sector_gaps/1"),
            ("time.tolerance", "/time/tolerance"),
            ("structure[front].spin.growth", "/structure/0/spin/growth"),
        ] {
            let scene = changed(path, Value::Float(0.25)).unwrap_or_else(|failure| panic!("{path}: {failure}"));
            let mut value = &Value::Table(scene);
            for key in found.split('/').skip(1) {
                value = match key.parse::<usize>() {
                    Ok(index) => &value[index],
                    Err(_) => &value[key],
                };
            }
            assert_eq!(value.as_float(), Some(0.25), "{path}");
        }
    }

    /// A range contains real numbers, but some keys need whole numbers.
    #[test]
    fn whole_numbers_of_ranges_are_accepted() {
        let excited = "structure[front].excitation.order";
        let order = |value: f64| {
            let scene = Value::Table(changed(excited, Value::Float(value)).unwrap());
            scene["structure"][0]["excitation"]["order"].clone()
        };
        assert_eq!([order(3.0), order(2.5)], [Value::Integer(3), Value::Float(2.5)]);
        let speed = changed("structure[front].speed", Value::Float(3.0)).unwrap();
        assert_eq!(speed["structure"][0]["speed"], Value::Float(3.0));
    }

    #[test]
    fn paths_to_the_same_key_have_one_unique_path() {
        let scene: Table = toml::from_str(SCENE).unwrap();
        for (path, place) in [
            ("structure[2].name", "structure[2].name"),
            ("structure[rear].name", "structure[2].name"),
            ("contact.master", "contact[1].master"),
            ("contact[1].sector_gaps", "contact[1].sector_gaps"),
            ("contact[1].sector_gaps[2]", "contact[1].sector_gaps[2]"),
            ("name", "name"),
        ] {
            assert_eq!(super::place(&scene, path).unwrap(), place, "{path}");
        }
    }

    #[test]
    fn unknown_keys_and_entries_are_explained() {
        for (path, words) in [
            ("contact[1].gapp", "Did you mean `contact.gap`?"),
            ("structure.speed", "a number from 1 to 2 or a name of front, rear"),
            ("structure[3].speed", "number from 1 to 2"),
            ("structure[middle].speed", "front, rear"),
            ("time[1].step", "without brackets"),
            ("contact[1.gap", "Give a path"),
            ("contact..gap", "Give a path"),
        ] {
            let failure = changed(path, Value::Boolean(true)).unwrap_err();
            assert!(failure.to_string().contains(words), "{path}: {failure}");
        }
    }
}
