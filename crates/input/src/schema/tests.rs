use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::*;
use crate::Finding;
use crate::toml_text::TomlText;

#[derive(Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct File {
    #[schemars(regex(pattern = NAME))]
    name: String,
    #[serde(default)]
    #[schemars(range(min = 10.0, max = 500.0))]
    gap_mm: Option<f64>,
    #[serde(default)]
    #[schemars(range(min = 1, max = 8))]
    count: u32,
    #[serde(default)]
    seed: u64,
    #[serde(default)]
    #[schemars(inner(range(min = -1.0, max = 1.0)), extend("x-unit" = "nm"))]
    offsets: [f64; 3],
    #[serde(default)]
    #[schemars(length(min = 2), inner(inner(range(min = 0.0, max = 1.0))))]
    points: Option<Vec<[f64; 2]>>,
    #[serde(default)]
    way: Option<Way>,
    #[serde(default, alias = "spacing_mm")]
    #[schemars(range(min = 1.0, max = 5.0), extend("x-former" = "spacing_mm"))]
    step_mm: Option<f64>,
    #[serde(default)]
    inside: Option<Inside>,
    #[serde(default)]
    many: Vec<Inside>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Way {
    /// There.
    Out,
    /// And back.
    #[serde(alias = "return")]
    #[schemars(extend("x-former" = "return"))]
    Back,
}

#[derive(Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Inside {
    #[schemars(range(max = 90.0), extend("exclusiveMinimum" = 0.0))]
    angle_deg: f64,
    #[serde(default)]
    is_on: bool,
}

fn read(text: &str) -> Result<File, Vec<Finding>> {
    let toml = TomlText::parse("f.toml", text).map_err(|finding| vec![finding])?;
    toml.read(&FileSchema::of::<File>())
}

/// Line, key, message and hint of the only finding.
#[track_caller]
fn only(text: &str) -> (usize, String, String, String) {
    let mut findings = read(text).expect_err("something is wrong");
    assert_eq!(findings.len(), 1, "{findings:?}");
    let found = findings.remove(0);
    (
        found.line.unwrap_or(0),
        found.key.unwrap_or_default(),
        found.message,
        found.hint.unwrap_or_default(),
    )
}

#[test]
fn former_names_are_read_with_a_note_each_and_not_beside_the_present_ones() {
    let text = "name = \"a\"\nspacing_mm = 2\nway = \"return\"\n";
    let file = read(text).unwrap();
    assert_eq!((file.step_mm, file.way), (Some(2.0), Some(Way::Back)));
    let schema = FileSchema::of::<File>();
    assert_eq!(
        TomlText::parse("f.toml", text)
            .unwrap()
            .former_names(&schema),
        [
            "`spacing_mm` is now `step_mm`; the old name is accepted until 0.2.0",
            "`way = \"return\"` is now `\"back\"`; the old name is accepted until 0.2.0",
        ]
    );
    let present = "name = \"a\"\nstep_mm = 2\nway = \"back\"\n";
    let toml = TomlText::parse("f.toml", present).unwrap();
    assert!(toml.former_names(&schema).is_empty());
    assert_eq!(
        only("name = \"a\"\nspacing_mm = 2\nstep_mm = 2\n"),
        (
            2,
            "spacing_mm".to_owned(),
            "`spacing_mm` is the former name of `step_mm`, which stands here too".to_owned(),
            "remove `spacing_mm`".to_owned()
        )
    );
    // Its limits are those of the key, and no hint proposes it.
    assert_eq!(only("name = \"a\"\nspacing_mm = 9\n").1, "spacing_mm");
    let (_, _, _, hint) = only("name = \"a\"\nspacin_mm = 2\n");
    assert!(!hint.contains("spacing_mm"), "{hint}");
    let (_, _, _, hint) = only("name = \"a\"\nway = \"retur\"\n");
    assert!(!hint.contains("return"), "{hint}");
    let properties = &schema.published()["properties"];
    assert_eq!(properties["spacing_mm"]["deprecated"], true);
    assert_eq!(properties["step_mm"]["deprecated"], Value::Null);
}

#[test]
fn what_fits_is_read_as_it_stands() {
    let file = read(
        "name = \"a-1\"\ngap_mm = 10\ncount = 8\nseed = 9223372036854775807\noffsets = [-1, 0.5, 1.0]\n\
         points = [[0, 1], [0.25, 0.5]]\nway = \"back\"\n[inside]\nangle_deg = 90\nis_on = true\n\
         [[many]]\nangle_deg = 1e-3\n[[many]]\nangle_deg = 1\n",
    )
    .unwrap();
    assert_eq!((file.gap_mm, file.count), (Some(10.0), 8));
    assert_eq!(file.seed, 9_223_372_036_854_775_807);
    assert_eq!(file.offsets, [-1.0, 0.5, 1.0]);
    assert_eq!(file.points.unwrap(), [[0.0, 1.0], [0.25, 0.5]]);
    assert_eq!(file.way, Some(Way::Back));
    assert!(file.inside.unwrap().is_on);
    assert_eq!(file.many[0].angle_deg, 1e-3);
}

#[test]
fn values_out_of_range_are_named_with_unit_and_range() {
    let (line, key, message, hint) = only("name = \"a\"\ngap_mm = 501");
    assert_eq!((line, key.as_str()), (2, "gap_mm"));
    assert_eq!(message, "`gap_mm` is 501 mm, outside 10 to 500");
    assert_eq!(hint, "the value is in mm");
    let hint = |text: &str| only(text).3;
    assert!(hint("name = \"a\"\ngap_mm = 0.02").ends_with("did you give metres?"));
    assert!(hint("name = \"a\"\ngap_mm = 5").ends_with("did you give centimetres?"));
    assert!(hint("name = \"a\"\ncount = 9").contains("without a unit"));
    let (_, key, message, _) = only("name = \"a\"\noffsets = [0, 0, 1.5]");
    assert_eq!(key, "offsets[2]");
    assert_eq!(message, "`offsets[2]` is 1.5 nm, outside -1 to 1");
    let (line, key, message, _) = only("name = \"a\"\npoints = [\n[0, 0],\n[0, 2]]");
    assert_eq!((line, key.as_str()), (4, "points[1][1]"));
    assert!(message.contains("is 2, outside 0 to 1"), "{message}");
    let (_, _, message, _) = only("name = \"a\"\n[inside]\nangle_deg = 0");
    assert!(
        message.ends_with("0 deg, outside 0 to 90, without 0 itself"),
        "{message}"
    );
    let (_, _, message, _) = only("name = \"a\"\nseed = -1");
    assert!(message.contains("is -1, outside 0 to"), "{message}");
    let (_, _, message, _) = only("name = \"a\"\nseed = 9223372036854775808");
    assert!(message.contains("more than 64 bits"), "{message}");
}

#[test]
fn values_of_another_type_are_named_with_what_belongs_there() {
    for (text, key, said) in [
        (
            "gap_mm = \"20 mm\"",
            "gap_mm",
            "expected a number, got `\"20 mm\"`",
        ),
        ("count = 1.5", "count", "expected a whole number, got `1.5`"),
        (
            "offsets = [1, 2]",
            "offsets",
            "`[1, 2]` has length 2, expected 3",
        ),
        (
            "points = [[1, 0]]",
            "points",
            "length 1, expected at least 2",
        ),
        (
            "points = [[1, 0], 3]",
            "points[1]",
            "expected a list, got `3`",
        ),
        (
            "offsets = { x = 1 }",
            "offsets",
            "expected a list, got `{ x = 1 }`",
        ),
        ("inside = 3", "inside", "expected a table, got `3`"),
        (
            "inside = { angle_deg = 1, is_on = 1 }",
            "inside.is_on",
            "true or false",
        ),
        ("way = 1", "way", "expected a string"),
        (
            "way = \"bak\"",
            "way",
            "`bak` is not a valid value of `way`",
        ),
        (
            "many = [{ angle_deg = true }]",
            "many[0].angle_deg",
            "expected a number",
        ),
        ("gap_mm = 2020-01-01", "gap_mm", "expected a number"),
    ] {
        let (line, at, message, _) = only(&format!("name = \"a\"\n{text}"));
        assert_eq!((line, at.as_str()), (2, key), "{text}");
        assert!(message.contains(said), "{message}");
    }
    assert_eq!(
        only("name = \"a\"\nway = \"bak\"").3,
        "did you mean `back`?"
    );
    assert!(
        only("name = \"a\"\ngap_mm = \"x\"")
            .3
            .contains("in millimetres")
    );
}

#[test]
fn unknown_and_missing_keys_are_named_where_they_belong() {
    let (line, key, message, hint) = only("name = \"a\"\n\n[insid]\nangle_deg = 1");
    assert_eq!((line, key.as_str()), (3, "insid"));
    assert_eq!(message, "unknown key `insid`");
    assert_eq!(hint, "did you mean `inside`?");
    // The wrong name is all that is wrong, though the right one is missing.
    let (line, key, _, hint) = only("name = \"a\"\n[inside]\nangle_rad = 1");
    assert_eq!((line, key.as_str()), (3, "inside.angle_rad"));
    assert_eq!(hint, "did you mean `angle_deg`? The key states the unit");
    let (line, key, message, _) = only("name = \"a\"\n[inside]\nis_on = true");
    assert_eq!((line, key.as_str()), (2, "inside.angle_deg"));
    assert_eq!(message, "the key `angle_deg` is missing");
    assert_eq!(only("count = 1").1, "name");
    assert_eq!(only("name = \"a b\"").2, "`a b` is not a usable name");
    let (_, key, _, _) = only("name = \"a\"\n\"odd key.\" = 1");
    assert_eq!(key, "\"odd key.\"");
}

#[test]
fn everything_that_is_wrong_is_found_in_the_order_of_the_file() {
    let findings = read("seed = -1\n[[many]]\nangle_deg = 99\n[[many]]\nis_on = 1\n").unwrap_err();
    let at: Vec<_> = findings
        .iter()
        .map(|found| (found.line, found.key.as_deref().unwrap_or_default()))
        .collect();
    assert_eq!(
        at,
        [
            (None, "name"),
            (Some(1), "seed"),
            (Some(3), "many[0].angle_deg"),
            (Some(4), "many[1].angle_deg"),
            (Some(5), "many[1].is_on"),
        ]
    );
}

#[test]
fn the_published_schema_has_no_nulls_formats_or_own_words() {
    let text = FileSchema::of::<File>().published().to_string();
    for word in ["null", "\"format\"", UNIT, HINT] {
        assert!(!text.contains(word), "{word} in {text}");
    }
    let schema = FileSchema::of::<File>().published();
    let count = &schema["properties"]["count"];
    assert_eq!(
        (&count["minimum"], &count["maximum"]),
        (&1.into(), &8.into())
    );
    assert_eq!(schema["properties"]["seed"]["maximum"], i64::MAX);
    assert_eq!(schema["properties"]["gap_mm"]["maximum"], 500.0);
}
