# SPDX-License-Identifier: Apache-2.0
# docs/register-map.csv as the tables of drivebridge-registers(7). Of blocks that repeat (bus1_...,
# bus2_...) the first is shown, with where the others are.

function heading(view, table,    name) {
	name = view " view: " table
	gsub(/_/, " ", name)
	return toupper(name)
}

function put(i,    text) {
	split("", row)
	split_csv(lines[i], row)
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
	text = column("description")
	if (i in most)
		text = text "; likewise 2 to " most[i] ", each " (second[i] - column("address")) \
			" registers further"
	if (text != "") {
		print ".br"
		print roff(text) "."
	}
}

FNR == 1 { read_header($0); next }
{
	split("", row)
	split_csv($0, row)
	name = column("name")
	if (match(name, /^[a-z]+[0-9]+_/) && column("table") == "holding" &&
	    column("view") != "vsmd") {
		block = substr(name, 1, RLENGTH - 1)
		number = block
		sub(/^[a-z]+/, "", number)
		sub(/[0-9]+$/, "", block)
		block = column("view") " " block substr(name, RLENGTH)
		if (number + 0 > 1 && block in first) {
			most[first[block]] = number + 0
			if (number + 0 == 2)
				second[first[block]] = column("address")
			next
		}
		first[block] = NR
	}
	lines[NR] = $0
	order[++count] = NR
}
END {
	for (n = 1; n <= count; n++)
		put(order[n])
}
