# SPDX-License-Identifier: Apache-2.0
# What the scripts of this folder share: reading CSV, writing roff.

# Fields of one line of CSV into field[1..]; quoted ones may hold commas and doubled quotes.
function split_csv(line, field,    count, i, c, quoted, text) {
	count = 0
	text = ""
	quoted = 0
	for (i = 1; i <= length(line); i++) {
		c = substr(line, i, 1)
		if (c == "\"") {
			if (quoted && substr(line, i + 1, 1) == "\"") {
				text = text c
				i++
			} else {
				quoted = !quoted
			}
		} else if (c == "," && !quoted) {
			field[++count] = text
			text = ""
		} else {
			text = text c
		}
	}
	field[++count] = text
	return count
}

# Columns by name, from the first line of a file.
function read_header(line,    names, count, i) {
	split("", at)
	count = split_csv(line, names)
	for (i = 1; i <= count; i++)
		at[names[i]] = i
}

function column(name) {
	if (!(name in at)) {
		print FILENAME ": no column " name > "/dev/stderr"
		exit 1
	}
	return row[at[name]]
}

# Text as roff shows it unchanged.
function roff(text) {
	gsub(/\\/, "\\e", text)
	gsub(/-/, "\\-", text)
	gsub(/\^/, "\\(ha", text)
	gsub(/~/, "\\(ti", text)
	if (text ~ /^[.']/)
		text = "\\&" text
	return text
}
