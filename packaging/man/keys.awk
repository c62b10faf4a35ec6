# SPDX-License-Identifier: Apache-2.0
# docs/config-keys.csv as the keys' part of drivebridge.conf(5), those of the tools in their own pages.

function title(section) {
	if (section == "bus" || section == "drive" || section == "role" || section == "modbus-rtu")
		return "SECTION " section " NAME"
	return "SECTION " section
}

function allowed(    words) {
	words = column("words")
	if (words != "") {
		gsub(/ /, ", ", words)
		return words (column("type") == "list" ? ", {\"NAME\", ...}" : "")
	}
	if (column("type") == "text")
		return (column("min") == 0 ? "at most " : column("min") " to ") column("max") " characters"
	if (column("min") != "")
		return column("min") " to " column("max") (column("unit") != "" ? " " column("unit") : "")
	if (column("type") == "family")
		return "name of a family"
	if (column("type") == "bus")
		return "name of a bus section"
	if (column("type") == "address")
		return "\"ADDRESS:PORT\""
	if (column("type") == "networks")
		return "{\"ADDRESS/PREFIX\", ...}"
	return column("type")
}

# Lists are in the table as they are easy to split.
function preset(    text) {
	text = column("default")
	if (column("type") == "networks") {
		gsub(/ /, "\", \"", text)
		return "{\"" text "\"}"
	}
	if (column("type") == "text" || column("type") == "address")
		return "\"" text "\""
	return text (column("unit") != "" ? " " column("unit") : "")
}

FNR == 1 { read_header($0); next }
{
	split("", row)
	split_csv($0, row)
	if (column("section") != section) {
		section = column("section")
		print ".SH \"" title(section) "\""
	}
	print ".TP"
	print ".BI \"" roff(column("name")) " = \" \"" "value" "\""
	print roff(column("description")) "."
	print ".br"
	text = "Allowed: " allowed() "."
	if (column("required") == "yes")
		text = text " Must be given."
	else if (column("default") != "")
		text = text " Default: " preset() "."
	if (column("families") != "all" && column("families") != "") {
		families = column("families")
		gsub(/ /, ", ", families)
		text = text " Families: " families "."
	}
	print roff(text)
}
