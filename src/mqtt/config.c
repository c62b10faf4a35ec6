/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/config.h"
#include "mqtt/keys.h"
#include "reader/reader.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define PASSWORD_MAX 1024

/* The service streams 128 registers at most; two of them are in every message. */
#define VALUES_MAX 126

/* A configuration while it is read. */
struct loading {
	struct db_mqtt_config *config;
	struct db_messages *messages;
	struct db_reader reader;
};

static void add_out_of_memory(struct loading *loading)
{
	db_messages_add_error(loading->messages, 0, "out of memory; free some and try again");
}

static const struct db_mqtt_key *find_row(const char *section, const char *name)
{
	for (const struct db_mqtt_key *row = db_mqtt_keys; row->name; row++) {
		if (strcmp(row->section, section) == 0 && (!name || strcmp(row->name, name) == 0))
			return row;
	}
	return NULL;
}

static const struct db_reader_key *find_given(const struct loading *loading,
                                              const struct db_mqtt_key *row)
{
	size_t section = db_reader_find_section(&loading->reader, row->section, "");

	return db_reader_find_key(&loading->reader, section, row->name);
}

/* The line of a key, or 0 when it was not given. */
static unsigned line_of(const struct loading *loading, const char *section, const char *name)
{
	const struct db_mqtt_key *row = find_row(section, name);
	const struct db_reader_key *given = row ? find_given(loading, row) : NULL;

	return given ? given->line : 0;
}

/* --- names ------------------------------------------------------------------------------------ */

static void check_section(struct loading *loading, size_t index)
{
	struct db_reader_section *section = &loading->reader.sections[index];

	if (!find_row(section->name, NULL))
		db_messages_add_error(
			loading->messages, section->line,
			"unknown section '%s'; there are service, broker, publish and command",
			section->name);
	else if (section->title[0] != '\0')
		db_messages_add_error(loading->messages, section->line,
		                      "section %s has no name, but '%s' was given; write %s {",
		                      section->name, section->title, section->name);
	else if (db_reader_find_section(&loading->reader, section->name, "") != index)
		db_messages_add_error(loading->messages, section->line,
		                      "there is a section %s already; write all its keys there",
		                      section->name);
	else
		return;
	section->refused = true;
}

static void check_name(struct loading *loading, struct db_reader_key *key)
{
	const struct db_reader_section *section = key->section == DB_READER_NO_SECTION ?
	                                                  NULL :
	                                                  &loading->reader.sections[key->section];
	char known[512] = "";
	size_t used = 0;

	if (section && section->refused)
		return;
	if (section && find_row(section->name, key->name)) {
		for (const struct db_reader_key *other = loading->reader.keys; other < key;
		     other++) {
			if (other->section == key->section && strcmp(other->name, key->name) == 0) {
				db_messages_add_error(
					loading->messages, key->line,
					"%s is set on line %u already; remove one of them",
					key->name, other->line);
				key->refused = true;
				return;
			}
		}
		return;
	}
	key->refused = true;
	for (const struct db_mqtt_key *row = db_mqtt_keys; row->name; row++) {
		if (section && strcmp(row->section, section->name) == 0 && used < sizeof(known))
			used += (size_t)snprintf(known + used, sizeof(known) - used, " %s",
			                         row->name);
	}
	if (section)
		db_messages_add_error(loading->messages, key->line,
		                      "unknown key '%s' in section %s; there are:%s", key->name,
		                      section->name, known);
	else
		db_messages_add_error(loading->messages, key->line,
		                      "key '%s' is outside of every section; there are service, "
		                      "broker, publish and command",
		                      key->name);
}

/* --- values ----------------------------------------------------------------------------------- */

/* The position of a word in a list with spaces between; false when it is none of them. */
static bool find_word(const char *words, const char *text, unsigned *position)
{
	size_t length = strlen(text);

	for (*position = 0; *words; (*position)++) {
		size_t size = strcspn(words, " ");

		if (size == length && memcmp(words, text, size) == 0)
			return true;
		words += size + (words[size] == ' ');
	}
	return false;
}

static bool find_number(const struct db_mqtt_key *row, const char *text, unsigned *number)
{
	char *end;
	unsigned long value;

	errno = 0;
	value = strtoul(text, &end, 10);
	*number = (unsigned)value;
	return isdigit((unsigned char)text[0]) && *end == '\0' && errno == 0 && value >= row->min &&
	       value <= row->max;
}

/* A value of a key that is no text. False: it is none. */
static bool keep_value(const struct db_mqtt_key *row, const char *text, void *member)
{
	switch (row->kind) {
	case DB_MQTT_NUMBER:
		return find_number(row, text, member);
	case DB_MQTT_LIST:
		return find_word(row->words, text, &((struct db_mqtt_list *)member)->word);
	case DB_MQTT_WORD:
	case DB_MQTT_TEXT:
	default:
		return find_word(row->words, text, member);
	}
}

static void refuse_value(struct loading *loading, const struct db_mqtt_key *row,
                         const struct db_reader_key *given)
{
	const char *text = given->count > 0 ? given->values : "";

	if (given->list)
		db_messages_add_error(loading->messages, given->line,
		                      "%s has one value, not a list; write %s = VALUE", row->name,
		                      row->name);
	else if (row->kind == DB_MQTT_NUMBER)
		db_messages_add_error(loading->messages, given->line,
		                      "%s = %s is no whole number from %u to %u%s%s", row->name,
		                      text, row->min, row->max, row->unit[0] ? " " : "", row->unit);
	else if (row->kind == DB_MQTT_TEXT)
		db_messages_add_error(loading->messages, given->line,
		                      "%s is too short or too long; %u to %u characters", row->name,
		                      row->min, row->max);
	else
		db_messages_add_error(
			loading->messages, given->line,
			"%s = %s is none of its words; one of: %s%s", row->name, text, row->words,
			row->kind == DB_MQTT_LIST ? ", or a list of names such as {\"a\", \"b\"}" :
						    "");
}

/* Copies bytes and a zero byte behind them. */
static char *copy_bytes(struct loading *loading, const char *bytes, size_t size)
{
	char *copy = calloc(1, size + 1);

	if (copy)
		memcpy(copy, bytes, size);
	else
		add_out_of_memory(loading);
	return copy;
}

static void read_text(struct loading *loading, const struct db_mqtt_key *row,
                      const struct db_reader_key *given, void *member)
{
	const char *text = given ? given->values : row->preset ? row->preset : "";
	size_t length = strlen(text);
	char *copy;

	/* A preset may say that there is none. */
	if (given && (given->list || length < row->min || length > row->max)) {
		refuse_value(loading, row, given);
		text = "";
		length = 0;
	}
	copy = copy_bytes(loading, text, length);
	/* gcc's analyzer does not see that the configuration has it now. */
	memcpy(member, &copy, sizeof(copy));
}

static void read_names(struct loading *loading, const struct db_reader_key *given, void *member)
{
	struct db_mqtt_list *list = member;

	list->word = DB_MQTT_NAMED;
	/* gcc's analyzer does not see that the configuration has it then. */
	list->names = copy_bytes(loading, given->size > 0 ? given->values : "", given->size);
}

static void read_key(struct loading *loading, const struct db_mqtt_key *row)
{
	const struct db_reader_key *given = find_given(loading, row);
	void *member = (char *)loading->config + row->offset;

	if (!given && !row->preset)
		db_messages_add_error(loading->messages, 0, "%s must be given in section %s: %s",
		                      row->name, row->section, row->description);
	if (row->kind == DB_MQTT_TEXT)
		read_text(loading, row, given, member);
	else if (given && given->list && row->kind == DB_MQTT_LIST)
		read_names(loading, given, member);
	else if (given && (given->list || !keep_value(row, given->values, member)))
		refuse_value(loading, row, given);
	else if (!given && row->preset && row->preset[0] != '\0')
		(void)keep_value(row, row->preset, member);
}

/* --- the whole -------------------------------------------------------------------------------- */

/* A level of a topic, or several. */
static bool is_topic(const char *text, bool levels)
{
	size_t length = strlen(text);

	return length > 0 && text[strcspn(text, "+#")] == '\0' && text[0] != '$' &&
	       text[0] != '/' && text[length - 1] != '/' && !strstr(text, "//") &&
	       (levels || !strchr(text, '/'));
}

static void check_topic(struct loading *loading, const char *name, const char *text, bool levels)
{
	if (!is_topic(text, levels))
		db_messages_add_error(
			loading->messages, line_of(loading, "publish", name),
			"%s = %s cannot be a part of topics: no + and #, no $ first, no "
			"empty level%s",
			name, text, levels ? "" : ", no /");
}

static void check_readable(struct loading *loading, const char *name, const char *path)
{
	FILE *file = path[0] ? fopen(path, "re") : NULL;

	if (path[0] && !file)
		db_messages_add_error(loading->messages, line_of(loading, "broker", name),
		                      "%s = %s: %s", name, path, strerror(errno));
	if (file)
		(void)fclose(file);
}

/* A secret that everybody can read is none. */
static void check_secret(struct loading *loading, const char *name, const char *path)
{
	struct stat status;

	if (path[0] && stat(path, &status) == 0 && (status.st_mode & (S_IROTH | S_IWOTH)) != 0)
		db_messages_add_error(
			loading->messages, line_of(loading, "broker", name),
			"%s = %s can be read or written by everybody: chmod 0640 %s, and "
			"chgrp it to the group of drivebridge-mqtt",
			name, path, path);
}

static void read_password(struct loading *loading)
{
	struct db_mqtt_config *config = loading->config;
	FILE *file = config->password_file[0] ? fopen(config->password_file, "re") : NULL;
	char line[PASSWORD_MAX] = "";

	if (file) {
		if (!fgets(line, sizeof(line), file))
			line[0] = '\0';
		(void)fclose(file);
		line[strcspn(line, "\r\n")] = '\0';
		if (line[0] == '\0')
			db_messages_add_error(loading->messages,
			                      line_of(loading, "broker", "password-file"),
			                      "password-file = %s has nothing in its first line",
			                      config->password_file);
	}
	config->password = strdup(line);
	explicit_bzero(line, sizeof(line));
	if (!config->password)
		add_out_of_memory(loading);
}

static void check_broker(struct loading *loading)
{
	struct db_mqtt_config *config = loading->config;

	if (config->port == 0)
		config->port = config->tls ? 8883 : 1883;
	if ((config->certificate_file[0] == '\0') != (config->key_file[0] == '\0'))
		db_messages_add_error(
			loading->messages,
			line_of(loading, "broker",
		                config->key_file[0] ? "key-file" : "certificate-file"),
			"certificate-file and key-file belong together; set both or none");
	if (config->password_file[0] && !config->user[0])
		db_messages_add_error(loading->messages,
		                      line_of(loading, "broker", "password-file"),
		                      "a password needs a user; set user");
	if (config->tls) {
		check_readable(loading, "ca-file", config->ca_file);
		check_readable(loading, "certificate-file", config->certificate_file);
		check_readable(loading, "key-file", config->key_file);
		check_secret(loading, "key-file", config->key_file);
	} else if (config->certificate_file[0]) {
		db_messages_add_error(loading->messages,
		                      line_of(loading, "broker", "certificate-file"),
		                      "certificate-file is for tls = on");
	} else if (config->password_file[0]) {
		db_messages_add_warning(loading->messages,
		                        line_of(loading, "broker", "password-file"),
		                        "without tls the password goes over the network as it is");
	}
	check_readable(loading, "password-file", config->password_file);
	check_secret(loading, "password-file", config->password_file);
	read_password(loading);
}

static void set_if_empty(struct loading *loading, char **text, const char *head, const char *name)
{
	if ((*text)[0] != '\0')
		return;
	free(*text);
	if (asprintf(text, "%s%s", head, name) < 0) {
		*text = NULL;
		add_out_of_memory(loading);
	}
}

static void check_values(struct loading *loading)
{
	const char *names = loading->config->values.names;
	size_t count = 0;

	for (; names && *names; names += strlen(names) + 1)
		count++;
	if (count > VALUES_MAX)
		db_messages_add_error(loading->messages, line_of(loading, "publish", "values"),
		                      "values has %zu names; %d at most", count, VALUES_MAX);
}

static void check_whole(struct loading *loading, const char *host_name)
{
	struct db_mqtt_config *config = loading->config;

	check_broker(loading);
	check_values(loading);
	set_if_empty(loading, &config->gateway, "", host_name);
	set_if_empty(loading, &config->client_id, "drivebridge-", config->gateway);
	if (!config->gateway || !config->client_id)
		return;
	check_topic(loading, "gateway", config->gateway, false);
	check_topic(loading, "prefix", config->prefix, true);
	check_topic(loading, "discovery-prefix", config->discovery_prefix, true);
	if (db_mqtt_config_commands(config) && config->version != DB_MQTT_VERSION_5)
		db_messages_add_error(
			loading->messages, line_of(loading, "broker", "mqtt-version"),
			"commands need mqtt-version = 5: in 3.1.1 a message does not show that it was "
			"published as a retained one");
}

static bool read_all(struct loading *loading, const char *host_name)
{
	static const struct db_reader_rules rules = {
		.sections = "service, broker, publish or command",
	};
	size_t before;

	if (!db_reader_read(&loading->reader, &rules, loading->messages))
		return false;
	for (size_t i = 0; i < loading->reader.section_count; i++)
		check_section(loading, i);
	for (size_t i = 0; i < loading->reader.key_count; i++)
		check_name(loading, &loading->reader.keys[i]);
	before = loading->messages->errors;
	for (const struct db_mqtt_key *row = db_mqtt_keys; row->name; row++)
		read_key(loading, row);
	if (loading->messages->errors == before)
		check_whole(loading, host_name);
	return loading->messages->errors == 0;
}

bool db_mqtt_config_parse(const char *text, const char *path, const char *host_name, FILE *out,
                          struct db_mqtt_config *config)
{
	struct db_source *source = db_sources_of_text(path, text);
	struct db_messages messages = { .sources = source, .source_count = 1 };
	struct loading loading = { .config = config, .messages = &messages };
	bool good;

	*config = (struct db_mqtt_config){ .socket = NULL };
	if (!source) {
		(void)fprintf(out, "%s: out of memory; free some and try again\n", path);
		return false;
	}
	good = read_all(&loading, host_name);
	db_messages_print(&messages, out);
	db_messages_clear(&messages);
	db_reader_clear(&loading.reader);
	db_sources_free(source, 1);
	return good;
}

bool db_mqtt_config_load(const char *path, const char *host_name, FILE *out,
                         struct db_mqtt_config *config)
{
	FILE *file = fopen(path, "re");
	char *text = NULL;
	size_t size = 0;
	/* All of it, for a text has no zero byte; negative also where there is nothing. */
	ssize_t length = file ? getdelim(&text, &size, '\0', file) : -1;
	bool good = false;

	*config = (struct db_mqtt_config){ .socket = NULL };
	if (file && !ferror(file))
		good = db_mqtt_config_parse(length >= 0 ? text : "", path, host_name, out, config);
	else
		(void)fprintf(out, "%s: %s\n", path, strerror(errno));
	if (file)
		(void)fclose(file);
	free(text);
	return good;
}

void db_mqtt_config_free(struct db_mqtt_config *config)
{
	for (const struct db_mqtt_key *row = db_mqtt_keys; row->name; row++) {
		void *member = (char *)config + row->offset;

		if (row->kind == DB_MQTT_TEXT)
			free(*(char **)member);
		else if (row->kind == DB_MQTT_LIST)
			free(((struct db_mqtt_list *)member)->names);
	}
	if (config->password)
		explicit_bzero(config->password, strlen(config->password));
	free(config->password);
	*config = (struct db_mqtt_config){ .socket = NULL };
}

bool db_mqtt_list_has(const struct db_mqtt_list *list, const char *name)
{
	for (const char *at = list->names; at && *at; at += strlen(at) + 1) {
		if (strcmp(at, name) == 0)
			return true;
	}
	return false;
}

bool db_mqtt_config_commands(const struct db_mqtt_config *config)
{
	return config->parameters == DB_MQTT_ON || config->allow.word != DB_MQTT_ALLOW_NONE;
}
