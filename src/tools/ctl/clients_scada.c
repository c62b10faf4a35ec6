/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/clients_text.h"
#include "ctl/ctl_private.h"
#include "ctl/session.h"

#include <string.h>

/* --- Kepware ---------------------------------------------------------------------------------- */

/* Longest description. */
#define KEPWARE_TEXT_MAX 255

static void put_tag(FILE *out, const char *group, const char *name, const json_t *reg,
                    const char *unit)
{
	char description[DB_CTL_DESCRIPTION_MAX] = "";
	size_t end = KEPWARE_TEXT_MAX;
	char text[256];

	snprintf(text, sizeof(text), "%s%s%s", group, group[0] ? "." : "", name);
	db_ctl_csv_add_text(out, true, text);
	snprintf(text, sizeof(text), "4%05lld",
	         json_integer_value(json_object_get(reg, "address")) + 1);
	db_ctl_csv_add_text(out, false, text);
	db_ctl_csv_add_text(out, false, db_ctl_client_type(reg)->kepware);
	db_ctl_csv_add_text(out, false, "1");
	db_ctl_csv_add_text(out, false,
	                    json_is_true(json_object_get(reg, "writable")) ? "R/W" : "RO");
	db_ctl_csv_add_text(out, false, "100");
	/* Eight empty columns: nothing is scaled or clamped. */
	for (int i = 0; i < 8; i++)
		db_ctl_csv_add_text(out, false, NULL);
	db_ctl_csv_add_text(out, false, unit);
	db_ctl_describe(reg, description);
	/* Do not cut inside a UTF-8 character. */
	while (end > 0 && ((unsigned char)description[end] & 0xc0) == 0x80)
		end--;
	description[end] = '\0';
	db_ctl_csv_add_text(out, false, description);
	db_ctl_csv_add_text(out, false, NULL);
	db_ctl_csv_end_line(out);
}

/* One of many registers of the same kind, of which the map has pages. */
static bool is_repeated(const char *name)
{
	static const char *const prefixes[] = { "history", "client", "line", "group_units" };

	for (size_t i = 0; i < sizeof(prefixes) / sizeof(prefixes[0]); i++) {
		size_t length = strlen(prefixes[i]);

		if (strncmp(name, prefixes[i], length) == 0 && name[length] >= '0' &&
		    name[length] <= '9')
			return true;
	}
	return false;
}

/* The gateway's device: its own registers, and the drives' windows as groups with their names. */
static void put_gateway_tags(const struct db_ctl_clients *of, FILE *out)
{
	size_t i;
	const json_t *reg;

	json_array_foreach(of->gateway, i, reg)
	{
		if (db_ctl_client_type(reg) && !is_repeated(db_words_text(reg, "name")))
			put_tag(out, "", db_words_text(reg, "name"), reg, db_ctl_unit_of(reg));
	}
	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		size_t at = 0;
		const char *name;

		while ((reg = db_ctl_next_of_window(of, drive, &at, &name)) != NULL)
			put_tag(out, db_ctl_drive_name(of, drive), name, reg,
			        db_ctl_unit_of(db_ctl_drive_register(of, drive, name)));
	}
}

void db_ctl_write_kepware(const struct db_ctl_clients *of, FILE *out)
{
	static const char *const heads[] = {
		"Tag Name",      "Address",    "Data Type",   "Respect Data Type",
		"Client Access", "Scan Rate",  "Scaling",     "Raw Low",
		"Raw High",      "Scaled Low", "Scaled High", "Scaled Data Type",
		"Clamp Low",     "Clamp High", "Eng Units",   "Description",
		"Negate Value",
	};
	size_t i;
	const json_t *reg;

	for (i = 0; i < sizeof(heads) / sizeof(heads[0]); i++)
		db_ctl_csv_add_text(out, i == 0, heads[i]);
	db_ctl_csv_end_line(out);
	if (of->chosen == json_array_size(of->drives)) {
		put_gateway_tags(of, out);
		return;
	}
	json_array_foreach(json_array_get(of->registers, of->chosen), i, reg)
	{
		if (db_ctl_client_type(reg) && !is_repeated(db_words_text(reg, "name")))
			put_tag(out, "", db_words_text(reg, "name"), reg, db_ctl_unit_of(reg));
	}
}

/* --- Ignition --------------------------------------------------------------------------------- */

#define DEVICE "drivebridge"

/* A tag of a device of the driver Modbus TCP with that name; its addresses count from 1. */
static json_t *make_tag(const struct db_ctl_clients *of, size_t drive, const json_t *reg)
{
	const struct db_ctl_client_type *type = db_ctl_client_type(reg);
	const json_t *min = json_object_get(reg, "min");
	const json_t *max = json_object_get(reg, "max");
	char description[DB_CTL_DESCRIPTION_MAX];
	char path[128];
	json_t *tag;

	db_ctl_describe(reg, description);
	snprintf(path, sizeof(path), "ns=1;s=[" DEVICE "]%lld.%s%lld",
	         json_integer_value(json_object_get(json_array_get(of->drives, drive), "unit")),
	         type->ignition, json_integer_value(json_object_get(reg, "address")) + 1);
	tag = json_pack("{s:s, s:s, s:s, s:s, s:s, s:s, s:s, s:b}", "name",
	                db_words_text(reg, "name"), "tagType", "AtomicTag", "valueSource", "opc",
	                "opcServer", "Ignition OPC UA Server", "opcItemPath", path, "dataType",
	                type->ignition_type, "documentation", description, "readOnly",
	                !json_is_true(json_object_get(reg, "writable")));
	if (db_ctl_unit_of(reg)[0] != '\0')
		(void)json_object_set_new(tag, "engUnit", json_string(db_ctl_unit_of(reg)));
	if (json_is_number(min) && json_is_number(max)) {
		(void)json_object_set(tag, "engLow", json_object_get(reg, "min"));
		(void)json_object_set(tag, "engHigh", json_object_get(reg, "max"));
		(void)json_object_set_new(tag, "engLimitMode", json_string("EngLimit_Clamp_None"));
	}
	return tag;
}

#define PROCESS_DATA 100 /* process data is below this address */

void db_ctl_write_ignition(const struct db_ctl_clients *of, FILE *out)
{
	json_t *folders = json_array();
	char text[512];
	json_t *root;

	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		json_t *tags = json_array();
		size_t i;
		const json_t *reg;

		json_array_foreach(json_array_get(of->registers, drive), i, reg)
		{
			/* Values to watch, and parameters. A command is one write of several
			 * registers, which tags cannot do. */
			if (db_ctl_client_type(reg) &&
			    (json_is_true(json_object_get(reg, "parameter")) ||
			     json_integer_value(json_object_get(reg, "address")) < PROCESS_DATA))
				(void)json_array_append_new(tags, make_tag(of, drive, reg));
		}
		(void)json_array_append_new(folders, json_pack("{s:s, s:s, s:o}", "name",
		                                               db_ctl_drive_name(of, drive),
		                                               "tagType", "Folder", "tags", tags));
	}
	snprintf(text, sizeof(text),
	         "Written by drivebridgectl export. Device " DEVICE
	         ": driver Modbus TCP, %s port %u, Reverse Numeric Word Order %s, zero-based "
	         "addressing off.",
	         of->host, of->port, of->low_word_first ? "off" : "on");
	root = json_pack("{s:s, s:s, s:s, s:o}", "name", "drivebridge", "tagType", "Folder",
	                 "documentation", text, "tags", folders);
	(void)json_dumpf(root, out, JSON_INDENT(2) | JSON_REAL_PRECISION(10));
	fputc('\n', out);
	json_decref(root);
}
