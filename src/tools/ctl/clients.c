/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/clients_text.h"
#include "ctl/ctl_private.h"
#include "ctl/say.h"
#include "ctl/units.h"
#include "words/nearest.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MODBUS_PORT 502

static const struct form {
	const char *name;
	void (*write)(const struct db_ctl_clients *of, FILE *out);
	bool of_one; /* also for one drive: with its own unit identifier */
} forms[] = {
	{ "telegraf", db_ctl_write_telegraf, false },
	{ "prometheus", db_ctl_write_prometheus, false },
	{ "modbus-exporter", db_ctl_write_modbus_exporter, false },
	{ "zabbix", db_ctl_write_zabbix, false },
	{ "home-assistant", db_ctl_write_home_assistant, false },
	{ "node-red", db_ctl_write_node_red, false },
	{ "kepware", db_ctl_write_kepware, true },
	{ "ignition", db_ctl_write_ignition, false },
	{ "codesys", db_ctl_write_codesys, false },
	{ "tia", db_ctl_write_tia, false },
	{ "notation", db_ctl_write_notation, true },
};

/* NULL: there is none, and the list of forms is printed. */
static const struct form *find_form(const struct db_ctl *ctl)
{
	json_t *list = json_array();
	char nearest[256] = "";
	char names[256] = "";
	size_t used = 0;

	for (size_t i = 0; i < sizeof(forms) / sizeof(forms[0]); i++) {
		if (ctl->form && strcmp(ctl->form, forms[i].name) == 0) {
			json_decref(list);
			return &forms[i];
		}
		(void)json_array_append_new(list, json_pack("{s:s}", "name", forms[i].name));
		used += (size_t)snprintf(names + used, sizeof(names) - used, "%s%s",
		                         i > 0 ? ", " : "", forms[i].name);
	}
	if (ctl->form)
		db_words_nearest_names(list, ctl->form, nearest, sizeof(nearest));
	json_decref(list);
	if (ctl->form)
		(void)db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                      "there is no form \"%s\"%s; --for takes %s", ctl->form,
		                      nearest, names);
	else
		(void)db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                      "say for what; --for takes %s", names);
	return NULL;
}

/* HOST, HOST:PORT, [V6] or [V6]:PORT; without a port the former one stays. */
static bool read_host(struct db_ctl_clients *of, const char *text)
{
	const char *colon = strrchr(text, ':');
	bool bracket = text[0] == '[';
	const char *end = bracket ? strchr(text, ']') : NULL;
	size_t length = strlen(text);
	char *rest = NULL;
	unsigned long port;

	/* An IPv6 address is in brackets. */
	if (bracket ? !end : colon && strchr(text, ':') != colon)
		return false;
	if (colon && (!bracket || colon == end + 1)) {
		port = strtoul(colon + 1, &rest, 10);
		if (*rest != '\0' || port < 1 || port > 65535)
			return false;
		of->port = (unsigned)port;
		length = (size_t)(colon - text);
	} else if (bracket && end[1] != '\0') {
		return false;
	}
	if (length == 0 || length >= sizeof(of->host) || strcspn(text, " \t\r\n\"") < length)
		return false;
	snprintf(of->host, sizeof(of->host), "%.*s", (int)length, text);
	return true;
}

/* Its drives are what the program reaches with one connection. "" is the section modbus. */
static enum db_ctl_status choose_endpoint(struct db_ctl *ctl, struct db_ctl_clients *of,
                                          const char *drive, const char **listen)
{
	const json_t *all = json_object_get(ctl->description, "drives");
	const json_t *endpoints = json_object_get(ctl->description, "endpoints");
	const json_t *named = drive ? db_words_look_up(all, drive) : NULL;
	const char *endpoint = ctl->endpoint ? ctl->endpoint : db_words_text(named, "endpoint");
	const json_t *found = db_words_look_up(endpoints, endpoint);
	char nearest[256] = "";
	const json_t *one;
	size_t i;

	*listen = db_words_text(found ? found : ctl->description, "listen");
	if (ctl->endpoint && !found) {
		db_words_nearest_names(endpoints, ctl->endpoint, nearest, sizeof(nearest));
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "there is no endpoint \"%s\"%s", ctl->endpoint, nearest);
	}
	json_array_foreach(all, i, one)
	{
		if (strcmp(db_words_text(one, "endpoint"), endpoint) == 0)
			(void)json_array_append_new(of->drives, json_deep_copy(one));
	}
	if (!ctl->endpoint && !drive && json_array_size(of->drives) < json_array_size(all))
		db_ctl_say_line(stderr,
		                "only the drives of the section modbus; --endpoint NAME for "
		                "those of another one");
	return DB_CTL_OK;
}

/* From --host; else this machine's name and the port that the service listens on. */
static enum db_ctl_status choose_host(const struct db_ctl *ctl, const char *listen,
                                      struct db_ctl_clients *of)
{
	const char *colon = strrchr(listen, ':');
	unsigned long port = colon ? strtoul(colon + 1, NULL, 10) : 0;

	of->port = port >= 1 && port <= 65535 ? (unsigned)port : MODBUS_PORT;
	if (!ctl->host && gethostname(of->host, sizeof(of->host) - 1) == 0)
		return DB_CTL_OK;
	if (ctl->host && read_host(of, ctl->host))
		return DB_CTL_OK;
	return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
	                       "--host %s: right is ADDRESS or ADDRESS:PORT, of IPv6 in brackets",
	                       ctl->host ? ctl->host : "");
}

/* All that the forms need to know of the gateway and its drives. */
static enum db_ctl_status gather(struct db_ctl *ctl, struct db_ctl_clients *of)
{
	enum db_ctl_status status;
	json_t *answer = NULL;
	size_t i;
	const json_t *drive;

	of->gateway = db_ctl_read_registers(ctl, "", &status);
	if (status == DB_CTL_OK)
		answer = db_ctl_call(ctl, "Registers",
		                     json_pack("{s:s, s:b}", "drive", "", "windows", 1),
		                     DB_CTL_TIMEOUT_MS, &status);
	of->windows = json_incref(json_object_get(answer, "registers"));
	json_decref(answer);
	json_array_foreach(of->drives, i, drive)
	{
		const char *name = db_words_text(drive, "name");
		double scale;

		if (status != DB_CTL_OK)
			break;
		(void)json_array_append_new(of->registers,
		                            db_ctl_read_registers(ctl, name, &status));
		scale = db_ctl_read_scale(ctl, name);
		(void)json_array_append_new(of->scales,
		                            scale > 0.0 ? json_real(scale) : json_null());
	}
	if (status == DB_CTL_OK && !json_object_get(json_array_get(of->gateway, 0), "address"))
		status = db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_BAD_ANSWER,
		                         "the service is of an earlier version and does not tell "
		                         "addresses: systemctl restart drivebridge");
	return status;
}

static enum db_ctl_status write_form(const struct db_ctl *ctl, const struct form *form,
                                     const struct db_ctl_clients *of)
{
	FILE *file = ctl->output ? fopen(ctl->output, "we") : NULL;
	FILE *out = ctl->output ? file : stdout;
	bool failed = !out;

	if (out) {
		form->write(of, out);
		failed = ferror(out) != 0 || fflush(out) != 0;
	}
	if (file)
		failed = fclose(file) != 0 || failed;
	if (!failed)
		return DB_CTL_OK;
	return db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.File", "%s: %s",
	                       ctl->output ? ctl->output : "standard output", strerror(errno));
}

/* The named drive or none; false with the reason printed. */
static enum db_ctl_status choose_drive(struct db_ctl *ctl, const struct form *form,
                                       struct db_ctl_clients *of, const char *name)
{
	of->chosen = json_array_size(of->drives);
	if (!name)
		return DB_CTL_OK;
	if (!form->of_one)
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "%s has all drives in one file", form->name);
	if (!db_ctl_find_drive(ctl, name))
		return DB_CTL_USAGE;
	for (size_t i = 0; i < json_array_size(of->drives); i++) {
		if (strcmp(db_ctl_drive_name(of, i), name) == 0)
			of->chosen = i;
	}
	return DB_CTL_OK;
}

enum db_ctl_status db_ctl_export(struct db_ctl *ctl, int count, char **arguments)
{
	struct db_ctl_clients of = {
		.buses = json_object_get(ctl->description, "buses"),
		.drives = json_array(),
		.low_word_first = json_is_true(json_object_get(ctl->description, "low_word_first")),
		.registers = json_array(),
		.scales = json_array(),
	};
	const struct form *form = find_form(ctl);
	const char *name = count > 0 ? arguments[0] : NULL;
	const char *listen = "";
	enum db_ctl_status status = form ? DB_CTL_OK : DB_CTL_USAGE;

	if (status == DB_CTL_OK)
		status = choose_endpoint(ctl, &of, name, &listen);
	if (status == DB_CTL_OK)
		status = choose_drive(ctl, form, &of, name);
	if (status == DB_CTL_OK)
		status = choose_host(ctl, listen, &of);
	if (status == DB_CTL_OK)
		status = gather(ctl, &of);
	if (status == DB_CTL_OK)
		status = write_form(ctl, form, &of);
	json_decref(of.drives);
	json_decref(of.gateway);
	json_decref(of.windows);
	json_decref(of.registers);
	json_decref(of.scales);
	return status;
}
