/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/say.h"
#include "words/value.h"

#include <ctype.h>
#include <string.h>

/* What the service keeps of one drive's commands. */
struct kept {
	const json_t *registers;
	const json_t *commands;
	const json_t *values;
};

static json_t *value_of(const struct kept *kept, unsigned number, const char *field)
{
	char name[64];

	snprintf(name, sizeof(name), "history%u_%s", number, field);
	return json_object_get(kept->values, name);
}

static const char *text_of(const struct kept *kept, unsigned number, const char *field)
{
	const char *text = json_string_value(value_of(kept, number, field));

	return text ? text : "";
}

static bool has_word(const char *text, const char *word)
{
	size_t length = strlen(word);

	for (const char *at = text; (at = strstr(at, word)) != NULL; at += length) {
		bool begins = at == text || at[-1] == ' ';
		char behind = at[length];

		if (begins && !isalnum((unsigned char)behind) && behind != '_')
			return true;
	}
	return false;
}

/* An argument of a kept command, from the field that its register's description names; NULL: no
 * field has it. */
static json_t *find_argument(const struct kept *kept, unsigned number, const char *argument)
{
	static const char *const fields[] = { "position", "position_2", "real", "number", "value" };

	for (size_t i = 0; i < sizeof(fields) / sizeof(fields[0]); i++) {
		char name[32];
		const json_t *reg;

		snprintf(name, sizeof(name), "history1_%s", fields[i]);
		reg = db_words_look_up(kept->registers, name);
		if (reg && has_word(db_words_text(reg, "description"), argument))
			return value_of(kept, number, fields[i]);
	}
	return NULL;
}

/* One line for programs; NULL: there are fewer entries. The caller frees it. */
static json_t *describe(const struct kept *kept, unsigned number)
{
	json_int_t code = json_integer_value(value_of(kept, number, "command"));
	const char *command = db_words_code_name(
		db_words_look_up(kept->registers, "history1_command"), code);
	const char *result = db_words_code_name(
		db_words_look_up(kept->registers, "result"),
		json_integer_value(value_of(kept, number, "result")));
	const json_t *row = command ? db_words_look_up(kept->commands, command) : NULL;
	json_t *arguments = json_object();
	size_t i;
	const json_t *argument;

	if (json_integer_value(value_of(kept, number, "timestamp_us")) == 0) {
		json_decref(arguments);
		return NULL;
	}
	json_array_foreach(json_object_get(row, "arguments"), i, argument)
	{
		const char *name = json_string_value(argument);
		json_t *value = find_argument(kept, number, name);

		if (value)
			(void)json_object_set(arguments, name, value);
	}
	/* For a parameter write: its register, as Modbus has it. */
	if (code == 0)
		(void)json_object_set_new(
			arguments, "register",
			json_integer(json_integer_value(value_of(kept, number, "number"))));
	return json_pack("{s:O, s:O, s:s, s:o, s:s, s:O, s:O, s:s, s:O, s:s}", "time_us",
	                 value_of(kept, number, "timestamp_us"), "sequence",
	                 value_of(kept, number, "sequence"), "command",
	                 code == 0 ? "write" :
	                 command   ? command :
	                             "?",
	                 "arguments", arguments, "result", result ? result : "?", "duration_us",
	                 value_of(kept, number, "duration_us"), "repeats",
	                 value_of(kept, number, "repeats"), "address",
	                 text_of(kept, number, "address"), "port", value_of(kept, number, "port"),
	                 "user", text_of(kept, number, "user"));
}

static void add_row(struct db_ctl_grid *grid, const struct kept *kept, const json_t *entry)
{
	const char *address = db_words_text(entry, "address");
	const char *user = db_words_text(entry, "user");
	const char *result = db_words_text(entry, "result");
	bool good = strcmp(result, "ok") == 0 || strcmp(result, "pending") == 0 ||
	            strcmp(result, "unproven") == 0;
	json_int_t port = json_integer_value(json_object_get(entry, "port"));
	json_int_t took = json_integer_value(json_object_get(entry, "duration_us"));
	char text[DB_WORDS_VALUE_MAX] = "";
	char value[DB_WORDS_VALUE_MAX];
	char when[DB_WORDS_TIME_MAX];
	size_t used = 0;
	const char *name;
	json_t *argument;

	db_words_write_time(json_integer_value(json_object_get(entry, "time_us")), when);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", when);
	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", db_words_text(entry, "command"));
	/* "target_position=6400 target_velocity=0", as run takes them. */
	json_object_foreach(json_object_get(entry, "arguments"), name, argument)
	{
		db_words_write_bare_value(db_words_look_up(kept->registers, name), argument, value,
		                          sizeof(value));
		if (used < sizeof(text))
			used += (size_t)snprintf(text + used, sizeof(text) - used, "%s%s=%s",
			                         used > 0 ? " " : "", name, value);
	}
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", text);
	db_ctl_grid_add(grid, good ? DB_CTL_PLAIN : DB_CTL_YELLOW, "%s", db_ctl_say_name(result));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.1f ms", (double)took / 1000.0);
	if (address[0] == '\0')
		snprintf(text, sizeof(text), "drivebridged");
	else if (strncmp(address, "control", 7) == 0)
		snprintf(text, sizeof(text), "%s%s%s", address, user[0] ? " for " : "", user);
	else
		/* A client on this machine has its user after the address. */
		snprintf(text, sizeof(text), "%.*s port %lld%s", (int)strcspn(address, ","),
		         address, (long long)port, address + strcspn(address, ","));
	db_words_clean(text);
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", text);
}

static void print_history(const struct db_ctl *ctl, const struct kept *kept)
{
	static const char *const heads[] = { DB_CTL_TEXT("WHEN"),      DB_CTL_TEXT("COMMAND"),
		                             DB_CTL_TEXT("ARGUMENTS"), DB_CTL_TEXT("RESULT"),
		                             DB_CTL_TEXT("TOOK"),      DB_CTL_TEXT("CLIENT") };
	struct db_ctl_grid *grid = ctl->json ? NULL : db_ctl_grid_new("llllrl");
	json_t *entry;

	if (grid)
		db_ctl_grid_add_heads(grid, heads, sizeof(heads) / sizeof(heads[0]));
	for (unsigned number = 1; (entry = describe(kept, number)) != NULL; number++) {
		if (ctl->json)
			db_ctl_print_json(entry);
		else if (grid)
			add_row(grid, kept, entry);
		json_decref(entry);
	}
	if (grid)
		db_ctl_grid_print(grid, ctl->colour, 0, "\n", stdout);
	db_ctl_grid_free(grid);
}

enum db_ctl_status db_ctl_history(struct db_ctl *ctl, int count, char **arguments)
{
	const json_t *drive = db_ctl_find_drive(ctl, arguments[0]);
	enum db_ctl_status status = drive ? DB_CTL_OK : DB_CTL_USAGE;
	const char *name = db_words_text(drive, "name");
	json_t *registers = drive ? db_ctl_read_registers(ctl, name, &status) : NULL;
	json_t *names = json_array();
	json_t *commands = NULL;
	json_t *answer = NULL;
	size_t i;
	const json_t *reg;

	(void)count;
	json_array_foreach(registers, i, reg)
	{
		if (strncmp(db_words_text(reg, "name"), "history", 7) == 0)
			(void)json_array_append(names, json_object_get(reg, "name"));
	}
	if (status == DB_CTL_OK)
		commands = db_ctl_call(ctl, "Commands", json_pack("{s:s}", "drive", name),
		                       DB_CTL_TIMEOUT_MS, &status);
	if (status == DB_CTL_OK)
		answer = db_ctl_call(ctl, "Read",
		                     json_pack("{s:s, s:O}", "drive", name, "names", names),
		                     DB_CTL_DRIVE_TIMEOUT_MS, &status);
	if (status == DB_CTL_OK) {
		const struct kept kept = {
			.registers = registers,
			.commands = json_object_get(commands, "commands"),
			.values = json_object_get(answer, "values"),
		};

		print_history(ctl, &kept);
	}
	json_decref(answer);
	json_decref(commands);
	json_decref(names);
	json_decref(registers);
	return status;
}
