//! `palpate campaign`: rows of presses as a Parquet file.

use palpate_cli::failure::Failure;
use palpate_simulate::campaign::{self, Arguments};
use serde_json::Value;

use crate::recording::parquet_file::{Head, Kind, ParquetFile};

/// Columns, in the order of a row's fields.
const HEADS: [Head<'_>; 13] = [
    head("seed", Kind::Integer(64), ""),
    head("world", Kind::Text, ""),
    head("load", Kind::Text, ""),
    head("true_N_per_m", Kind::Double, "N/m"),
    head("estimate_N_per_m", Kind::Double, "N/m"),
    head("lower_N_per_m", Kind::Double, "N/m"),
    head("upper_N_per_m", Kind::Double, "N/m"),
    head("load_ratio", Kind::Double, "1"),
    head("load_ratio_standard_error", Kind::Double, "1"),
    head("reduced_chi_square", Kind::Double, "1"),
    head("two_state_N_per_m", Kind::Double, "N/m"),
    head("covered", Kind::Bool, ""),
    head("reason", Kind::Text, ""),
];

const fn head(name: &'static str, kind: Kind, unit: &'static str) -> Head<'static> {
    Head {
        name,
        kind,
        unit,
        optional: true,
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    campaign::run(arguments, Some(parquet))
}

/// Formats rows as the bytes of a Parquet file.
fn parquet(rows: &[Value]) -> Result<Vec<u8>, String> {
    let mut file = ParquetFile::begin(Vec::new(), "press", &HEADS).map_err(text)?;
    for row in rows {
        let columns = row.as_object().map(serde_json::Map::len);
        if columns != Some(HEADS.len()) || HEADS.iter().any(|head| row.get(head.name).is_none()) {
            return Err(format!("its columns are not those of a row: {row}"));
        }
        let cell = |head: &Head<'_>| row.get(head.name).filter(|cell| !cell.is_null()).cloned();
        file.add(HEADS.iter().map(cell).collect::<Vec<Option<Value>>>())
            .map_err(text)?;
    }
    file.finish().map_err(text)
}

fn text(error: impl ToString) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use ::parquet::file::reader::{FileReader, SerializedFileReader};
    use ::parquet::record::RowAccessor;
    use serde_json::json;

    use super::*;

    #[test]
    fn rows_are_read_back_with_their_units() {
        let row = HEADS.iter().map(|head| (head.name.to_owned(), Value::Null));
        let mut row = Value::Object(row.collect());
        row["seed"] = json!(u64::MAX);
        row["true_N_per_m"] = json!(2_500.062_5);
        row["covered"] = json!(true);
        let file = parquet(&[row]).unwrap();
        let mut written = tempfile::tempfile().unwrap();
        written.write_all(&file).unwrap();
        let reader = SerializedFileReader::new(written).unwrap();
        let rows: Vec<_> = reader.get_row_iter(None).unwrap().collect();
        assert_eq!(rows.len(), 1);
        let row = rows[0].as_ref().unwrap();
        assert_eq!(row.get_ulong(0).unwrap(), u64::MAX);
        assert_eq!(row.get_double(3).unwrap(), 2_500.062_5);
        assert!(row.get_bool(11).unwrap());
        assert!(row.get_string(12).is_err());
        let metadata = reader.metadata().file_metadata();
        let mut units = metadata.key_value_metadata().unwrap().iter();
        let units = units.find(|of| of.key == "units").unwrap();
        let units = units.value.as_ref().unwrap();
        assert!(units.contains("\"true_N_per_m\":\"N/m\""));
    }
    #[test]
    fn a_row_with_other_columns_is_refused() {
        let whole = HEADS.iter().map(|head| (head.name.to_owned(), Value::Null));
        let mut more = Value::Object(whole.collect());
        assert!(parquet(&[more.clone()]).is_ok());
        more["further"] = json!(1);
        assert!(parquet(&[more]).unwrap_err().contains("further"));
        assert!(parquet(&[json!({"seed": 1})]).is_err());
    }
}
