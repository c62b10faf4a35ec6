# SPDX-License-Identifier: Apache-2.0
# Leaves out the comments that have lines of their own, a sixth of what a browser loads, indentation and empty lines. No
# text of a script goes over several lines.
/^[[:space:]]*\/\*.*\*\/[[:space:]]*$/d
/^[[:space:]]*\/\*/,/\*\/[[:space:]]*$/d
/^[[:space:]]*\/\//d
s/^\t*//
/^$/d
