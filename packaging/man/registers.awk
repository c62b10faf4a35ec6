# SPDX-License-Identifier: Apache-2.0
# docs/register-map.csv as the tables of drivebridge-registers(7).

function heading(view, table,    name) {
	name = view " view: " table
	gsub(/_/, " ", name)
	return toupper(name)
}

FNR == 1 { read_header($0); next }
{
	split("", row)
	split_csv($0, row)
	key = column("view") "/" column("table")
	if (key != last) {
		last = key
		print ".SH \"" roff(heading(column("view"), column("table"))) "\""
	}
	print ".TP"
	print ".BR \"" column("address") " " roff(column("name")) "\" \" (" column("reference") ")\""
	text = column("type") ", " column("access")
	if (column("unit") != "")
		text = text ", " column("unit")
	if (column("min") != "" || column("max") != "")
		text = text ", " column("min") " to " column("max")
	if (column("families") != "all")
		text = text ", " column("families")
	print roff(text) "."
	if (column("description") != "") {
		print ".br"
		print roff(column("description")) "."
	}
}
