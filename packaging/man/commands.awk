# SPDX-License-Identifier: Apache-2.0
# docs/commands.csv as a list.

FNR == 1 { read_header($0); next }
{
	split("", row)
	split_csv($0, row)
	print ".TP"
	print ".BR \"" column("code") " " roff(column("name")) "\""
	text = roff(column("description")) "."
	if (column("arguments") != "") {
		arguments = column("arguments")
		gsub(/ /, ", ", arguments)
		text = text " Arguments: " roff(arguments) "."
	}
	if (column("families") != "all")
		text = text " Families: " roff(column("families")) "."
	print text
}
