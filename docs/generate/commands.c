/* SPDX-License-Identifier: Apache-2.0 */
/*
 * ctl-export csv|bash|zsh: what is made of the table of drivebridgectl: docs/drivebridgectl.csv, of which the manual
 * page is made, and the shells' completions in packaging/completions.
 */
#include "ctl/lookup.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A field of CSV: quoted when it has to be. */
static void put_field(const char *text, char end)
{
	bool quoted = strpbrk(text, ",\"") != NULL;

	(void)printf("%s%s%s%c", quoted ? "\"" : "", text, quoted ? "\"" : "", end);
}

static void write_csv(void)
{
	int task = -1;

	(void)puts("kind,name,arguments,commands,description");
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		if (!command->description)
			continue;
		if ((int)command->task != task) {
			task = (int)command->task;
			(void)printf("task,%s,,,", db_ctl_tasks[task].example);
			put_field(db_ctl_tasks[task].title, '\n');
		}
		(void)printf("command,%s,", command->name);
		put_field(command->arguments, ',');
		put_field("", ',');
		put_field(command->description, '\n');
	}
	for (const struct db_ctl_option *option = db_ctl_options; option->name; option++) {
		(void)printf("option,%s,", option->name);
		put_field(option->value ? option->value : "", ',');
		(void)printf("%.*s,", option->commands ? (int)strlen(option->commands) - 2 : 0,
		             option->commands ? option->commands + 1 : "");
		put_field(option->description, '\n');
	}
}

/* Those of a command, or those of all. */
static void write_options(const struct db_ctl_command *command)
{
	const char *gap = "";

	for (const struct db_ctl_option *option = db_ctl_options; option->name; option++) {
		if (command ? !db_ctl_takes_option(command, option) : option->commands != NULL)
			continue;
		(void)printf("%s--%s", gap, option->name);
		gap = " ";
	}
}

static void write_valued(void)
{
	const char *gap = "";

	for (const struct db_ctl_option *option = db_ctl_options; option->name; option++) {
		/* The socket is kept, see there. */
		if (!option->value || strcmp(option->name, "socket") == 0)
			continue;
		(void)printf("%s--%s", gap, option->name);
		gap = " | ";
	}
}

/* Letters of the first word of its name. */
static int count_first(const struct db_ctl_command *command)
{
	return (int)strcspn(command->name, " ");
}

/* Whether it is the first of those whose names begin with the same one of two words. */
static bool begins_group(const struct db_ctl_command *command)
{
	size_t first = (size_t)count_first(command);

	if (command->name[first] == '\0')
		return false;
	for (const struct db_ctl_command *before = db_ctl_commands; before != command; before++) {
		if (strncmp(before->name, command->name, first + 1) == 0)
			return false;
	}
	return true;
}

/* Prints the second words of all commands whose first word is this one, as "save" of "params save". */
static void write_second_words(const char *first, size_t length)
{
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		if (strncmp(command->name, first, length) == 0 && command->name[length] == ' ')
			(void)printf("%s ", command->name + length + 1);
	}
}

static bool is_command(const char *name, size_t length)
{
	const struct db_ctl_command *command = db_ctl_commands;

	while (command->name &&
	       (strncmp(command->name, name, length) != 0 || command->name[length] != '\0'))
		command++;
	return command->name != NULL;
}

/* First words that are no command by themselves. */
static void write_groups(void)
{
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		size_t first = (size_t)count_first(command);

		if (!begins_group(command) || is_command(command->name, first))
			continue;
		(void)printf("\t%.*s) printf '%%s\\n' ", (int)first, command->name);
		write_second_words(command->name, first);
		(void)puts("; return ;;");
	}
}

/* Both shells ask the same function what can stand next; only what they do with it differs. */
static void write_next_words(void)
{
	(void)puts(
		"# Prints what can stand behind these words, one a line; \"files\" as the last one stands for "
		"file names.");
	(void)puts("_drivebridgectl_next() {");
	(void)puts("\tlocal word kind command='' kinds='' socket=() rest=()");
	(void)puts("\twhile [ $# -gt 0 ]; do");
	(void)puts("\t\tword=$1");
	(void)puts("\t\tshift");
	(void)puts("\t\tcase $word in");
	(void)puts("\t\t--socket) socket=(--socket \"${1:-}\") && [ $# -eq 0 ] || shift ;;");
	(void)puts("\t\t--socket=*) socket=(\"$word\") ;;");
	(void)printf("\t\t");
	write_valued();
	(void)puts(") [ $# -eq 0 ] || shift ;;");
	(void)puts("\t\t-*) ;;");
	(void)puts("\t\t*) case $command in '') command=$word ;;");
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		if (begins_group(command))
			(void)printf("\t\t\t%.*s) command=\"$command $word\" ;;\n",
			             count_first(command), command->name);
	}
	(void)puts("\t\t\t*) rest+=(\"$word\") ;; esac ;;");
	(void)puts("\t\tesac");
	(void)puts("\tdone");
	(void)puts("\tcase $command in");
	(void)puts("\t'') printf '%s\\n' \\");
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		if (command->description &&
		    (command->name[count_first(command)] == '\0' || begins_group(command)))
			(void)printf("\t\t%.*s \\\n", count_first(command), command->name);
	}
	(void)printf("\t\t");
	write_options(NULL);
	(void)puts("");
	(void)puts("\t\treturn ;;");
	write_groups();
	for (const struct db_ctl_command *command = db_ctl_commands; command->name; command++) {
		if (!command->description)
			continue;
		(void)printf("\t'%s') kinds='%s%s' && printf '%%s\\n' ", command->name,
		             command->kinds, command->max > 0 ? " -" : "");
		write_second_words(command->name, strlen(command->name));
		write_options(command);
		(void)puts(" ;;");
	}
	(void)puts("\tesac");
	(void)puts(
		"\t# The kind of the next argument: as many as there are, then the last again and again.");
	(void)puts(
		"\tset -- ${kinds}\n\tfor word in \"${rest[@]}\"; do [ $# -lt 2 ] || shift; done");
	(void)puts("\tkind=${1:-}\n\tcase $kind in\n\t'' | -) ;;");
	(void)puts("\tfiles) printf 'files\\n' ;;");
	(void)puts("\twords) _drivebridgectl_next ;;\n"
	           "\tdrives-or-files) drivebridgectl \"${socket[@]}\" names drives 2>/dev/null");
	(void)puts("\t\tprintf '%s\\n' default files ;;");
	(void)puts("\t*) drivebridgectl \"${socket[@]}\" names \"$kind\" \"${rest[@]:0:2}\" "
	           "2>/dev/null ;;");
	(void)puts("\tesac");
	(void)puts("}");
	(void)puts("");
}

static void write_bash(void)
{
	(void)puts("# SPDX-License-Identifier: Apache-2.0");
	(void)puts("# shellcheck shell=bash");
	(void)puts(
		"# bash completion of drivebridgectl, made by ctl-export from the table of its commands.");
	(void)puts("");
	write_next_words();
	(void)puts("_drivebridgectl() {");
	(void)puts("\tlocal current=${COMP_WORDS[COMP_CWORD]} next");
	(void)puts("");
	(void)puts("\tnext=$(_drivebridgectl_next \"${COMP_WORDS[@]:1:COMP_CWORD-1}\")");
	(void)puts("\tmapfile -t COMPREPLY < <(compgen -W \"${next%files}\" -- \"$current\")");
	(void)puts("\tcase $next in");
	(void)puts("\t*files) mapfile -t -O \"${#COMPREPLY[@]}\" COMPREPLY < <(compgen -f -- "
	           "\"$current\") ;;");
	(void)puts("\tesac");
	(void)puts("\t# Behind NAME= a value follows, not the next word.");
	(void)puts("\tcase ${COMPREPLY[*]} in *=) compopt -o nospace 2>/dev/null ;; esac");
	(void)puts("}");
	(void)puts("complete -F _drivebridgectl drivebridgectl");
}

static void write_zsh(void)
{
	(void)puts("#compdef drivebridgectl");
	(void)puts("# SPDX-License-Identifier: Apache-2.0");
	(void)puts(
		"# zsh completion of drivebridgectl, made by ctl-export from the table of its commands.");
	(void)puts("");
	write_next_words();
	(void)puts("_drivebridgectl() {");
	(void)puts("\tlocal -a next");
	(void)puts("");
	(void)puts("\tsetopt localoptions shwordsplit");
	(void)puts("\tnext=(${(f)\"$(_drivebridgectl_next \"${(@)words[2,CURRENT-1]}\")\"})");
	(void)puts("\tif [[ ${next[-1]:-} == files ]]; then");
	(void)puts("\t\tnext[-1]=()");
	(void)puts("\t\t_files");
	(void)puts("\tfi");
	(void)puts("\tcompadd -- ${next:#*=}");
	(void)puts("\tcompadd -S '' -- ${(M)next:#*=}");
	(void)puts("}");
	(void)puts("_drivebridgectl \"$@\"");
}

int main(int argc, char **argv)
{
	static const struct {
		const char *name;
		void (*write)(void);
	} forms[] = { { "csv", write_csv }, { "bash", write_bash }, { "zsh", write_zsh } };

	for (size_t i = 0; argc == 2 && i < sizeof(forms) / sizeof(forms[0]); i++) {
		if (strcmp(forms[i].name, argv[1]) == 0) {
			forms[i].write();
			return fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
		}
	}
	(void)fputs("usage: ctl-export csv|bash|zsh\n", stderr);
	return 2;
}
