# SPDX-License-Identifier: Apache-2.0
# docs/drivebridgectl.csv as the commands and options of drivebridgectl(1).

# What is to be replaced by something, and what is typed as it stands.
function arguments(text,    out, word) {
	out = ""
	while (match(text, /[A-Z]+/)) {
		out = out roff(substr(text, 1, RSTART - 1)) "\\fI" substr(text, RSTART, RLENGTH) "\\fR"
		text = substr(text, RSTART + RLENGTH)
	}
	return out roff(text)
}

FNR == 1 { read_header($0); next }
{
	split("", row)
	split_csv($0, row)
	if (FNR == 2)
		print ".SH COMMANDS"
	if (column("kind") == "task") {
		print ".SS " roff(column("description"))
		print ".nf\n\\fBdrivebridgectl " roff(column("name")) "\\fR\n.fi"
		next
	}
	if (column("kind") != kind && column("kind") == "option")
		print ".SH OPTIONS"
	kind = column("kind")
	print ".TP"
	text = column("kind") == "command" ? column("name") : "--" column("name")
	print "\\fB" roff(text) "\\fR" (column("arguments") != "" ? " " arguments(column("arguments")) : "")
	text = column("description")
	print roff(text) "."
	if (column("commands") != "")
		print "With \\fB" roff(column("commands")) "\\fR."
}
