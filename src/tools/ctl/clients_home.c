/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/clients_text.h"
#include "ctl/ctl_private.h"
#include "ctl/session.h"
#include "words/value.h"

#include <stdlib.h>
#include <string.h>

/* --- Home Assistant --------------------------------------------------------------------------- */

static void put_entity(FILE *out, const struct db_ctl_clients *of, size_t drive, const char *name,
                       const json_t *reg, json_int_t unit, const char *input)
{
	const char *called = db_ctl_drive_name(of, drive);
	char text[512];

	snprintf(text, sizeof(text), "%s %s", called, name);
	for (char *at = text; *at; at++)
		*at = *at == '_' && at > text + strlen(called) ? ' ' : *at;
	fputs("      - name: ", out);
	db_ctl_put_quoted(out, text);
	snprintf(text, sizeof(text), "drivebridge_%s_%u_%s_%s", of->host, of->port, called, name);
	fputs("\n        unique_id: ", out);
	db_ctl_put_quoted(out, text);
	fprintf(out,
	        "\n        slave: %lld\n        address: %lld\n        input_type: %s\n"
	        "        scan_interval: 5\n",
	        (long long)unit, json_integer_value(json_object_get(reg, "address")), input);
}

/* In the user's units if they have a name. */
static void put_quantity(FILE *out, const struct db_ctl_clients *of, size_t drive, const char *own,
                         const char *users)
{
	const json_t *reg = db_ctl_drive_register(of, drive, users);
	const char *rpm = db_ctl_unit_of(db_ctl_drive_register(of, drive, own));
	const struct db_ctl_client_type *type;
	json_int_t unit = json_integer_value(
		json_object_get(json_array_get(of->drives, drive), "unit"));

	if (!reg || db_ctl_unit_of(reg)[0] == '\0' || strcmp(rpm, "rpm") == 0)
		reg = db_ctl_drive_register(of, drive, own);
	if (!reg)
		return;
	type = db_ctl_client_type(reg);
	put_entity(out, of, drive, own, reg, unit, "holding");
	fprintf(out, "        data_type: %s\n        state_class: measurement\n", type->home);
	if (strcmp(type->type, "f32") == 0)
		fputs("        precision: 2\n", out);
	if (db_ctl_unit_of(reg)[0] != '\0') {
		fputs("        unit_of_measurement: ", out);
		db_ctl_put_quoted(out, db_ctl_unit_of(reg));
		fputc('\n', out);
	}
	if (of->low_word_first && type->registers > 1)
		fputs("        swap: word\n", out);
}

void db_ctl_write_home_assistant(const struct db_ctl_clients *of, FILE *out)
{
	fprintf(out,
	        "# Written by drivebridgectl export: %zu drives of %s, for configuration.yaml\n"
	        "# What a drive tells is read from its own unit, so that it is unavailable when it "
	        "does not answer.\n"
	        "modbus:\n  - name: drivebridge\n    type: tcp\n    host: ",
	        json_array_size(of->drives), of->host);
	db_ctl_put_quoted(out, of->host);
	fprintf(out, "\n    port: %u\n    timeout: 3\n    sensors:\n", of->port);
	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		put_quantity(out, of, drive, "position", "position_units");
		put_quantity(out, of, drive, "velocity", "velocity_units");
	}
	fputs("    binary_sensors:\n", out);
	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		size_t at = 0;
		const char *name;
		const json_t *reg;

		while ((reg = db_ctl_next_of_window(of, drive, &at, &name)) != NULL) {
			if (strcmp(name, "online") != 0)
				continue;
			put_entity(out, of, drive, name, reg, DB_CTL_GATEWAY_UNIT, "holding");
			fputs("        device_class: connectivity\n", out);
		}
		reg = db_ctl_drive_register(of, drive, "moving");
		if (reg) {
			put_entity(out, of, drive, "moving", reg,
			           json_integer_value(json_object_get(
					   json_array_get(of->drives, drive), "unit")),
			           "discrete_input");
			fputs("        device_class: moving\n", out);
		}
		reg = db_ctl_drive_register(of, drive, "error_stop");
		if (reg) {
			put_entity(out, of, drive, "error_stop", reg,
			           json_integer_value(json_object_get(
					   json_array_get(of->drives, drive), "unit")),
			           "discrete_input");
			fputs("        device_class: problem\n", out);
		}
	}
}

/* --- Node-RED --------------------------------------------------------------------------------- */

/* Most registers of one read. */
#define READ_MAX 125

#define FLOW "db00000000000001"
#define CLIENT "db00000000000002"
#define DECODE "db00000000000003"
#define SHOW "db00000000000004"

/* Follows the tables of names and fields. */
static const char decode[] =
	"const data = Buffer.alloc(2 * msg.payload.length);\n"
	"msg.payload.forEach((word, at) => data.writeUInt16BE(word, 2 * at));\n"
	"const wide = at => lowWordFirst ? data.readUInt16BE(at + 2) * 65536 + "
	"data.readUInt16BE(at) : data.readUInt32BE(at);\n"
	"const real = at => {\n"
	"    const bytes = Buffer.alloc(4);\n"
	"    bytes.writeUInt32BE(wide(at));\n"
	"    return bytes.readFloatBE();\n"
	"};\n"
	"const read = {\n"
	"    u16: at => data.readUInt16BE(at), i16: at => data.readInt16BE(at), bits16: at => "
	"data.readUInt16BE(at),\n"
	"    u32: wide, i32: at => wide(at) | 0, bits32: wide, f32: real,\n"
	"};\n"
	"msg.payload = [];\n"
	"for (let first = 0; first + size <= data.length; first += size) {\n"
	"    const drive = {};\n"
	"    for (const [name, register, type] of fields) {\n"
	"        drive[name] = read[type](first + 2 * register);\n"
	"    }\n"
	"    drive.name = names[drive.unit];\n"
	"    msg.payload.push(drive);\n"
	"}\n"
	"return msg;\n";

/* The function of the node that makes an object for each drive; the caller frees it. */
static char *make_decoder(const struct db_ctl_clients *of, json_int_t first, json_int_t size)
{
	char *text = NULL;
	size_t length = 0;
	FILE *out = open_memstream(&text, &length);
	size_t at = 0;
	const char *name;
	const json_t *reg;
	const char *gap = "";
	size_t i;
	const json_t *drive;

	if (!out)
		return NULL;
	fputs("const names = {", out);
	json_array_foreach(of->drives, i, drive)
	{
		fprintf(out, "%s%lld: ", gap, json_integer_value(json_object_get(drive, "unit")));
		db_ctl_put_quoted(out, db_words_text(drive, "name"));
		gap = ", ";
	}
	fputs("};\n// name, register from the first of the window, type\nconst fields = [\n", out);
	gap = "";
	while ((reg = db_ctl_next_of_window(of, 0, &at, &name)) != NULL) {
		fprintf(out, "%s    [\"%s\", %lld, \"%s\"]", gap, name,
		        (long long)(db_words_number(reg, "address") - first),
		        db_words_text(reg, "type"));
		gap = ",\n";
	}
	fprintf(out, "\n];\nconst size = %lld;\nconst lowWordFirst = %s;\n%s",
	        (long long)(2 * size), of->low_word_first ? "true" : "false", decode);
	(void)fclose(out);
	return text;
}

/* Distance of two windows; the last drive's window ends after its registers. */
static json_int_t window_size(const struct db_ctl_clients *of)
{
	size_t at = 0;
	const char *name;
	const json_t *first = db_ctl_next_of_window(of, 0, &at, &name);
	const json_t *reg;
	json_int_t end = 0;

	at = 0;
	reg = db_ctl_next_of_window(of, 1, &at, &name);
	if (reg)
		return db_words_number(reg, "address") - db_words_number(first, "address");
	at = 0;
	while ((reg = db_ctl_next_of_window(of, 0, &at, &name)) != NULL)
		end = db_words_number(reg, "address") + db_ctl_client_type(reg)->registers;
	return end - db_words_number(first, "address");
}

/* Reads all windows once a second, with as few reads as possible. */
static void add_reads(json_t *nodes, size_t drives, json_int_t first, json_int_t size)
{
	size_t in_one = (size_t)(READ_MAX / size);

	for (size_t at = 0, number = 0; at < drives; at += in_one, number++) {
		size_t count = drives - at < in_one ? drives - at : in_one;
		char id[32];
		char name[64];
		char from[24];
		char quantity[24];

		snprintf(id, sizeof(id), "db00000000001%03zx", number);
		snprintf(name, sizeof(name), "drives from %zu", at + 1);
		snprintf(from, sizeof(from), "%lld", (long long)(first + (json_int_t)at * size));
		snprintf(quantity, sizeof(quantity), "%lld", (long long)((json_int_t)count * size));
		(void)json_array_append_new(
			nodes,
			json_pack(
				"{s:s, s:s, s:s, s:s, s:s, s:b, s:b, s:s, s:s, s:s, s:s, s:s, s:s, "
				"s:b, s:s, s:b, s:i, s:i, s:[[s],[]]}",
				"id", id, "type", "modbus-read", "z", FLOW, "name", name, "topic",
				"", "showStatusActivities", 1, "showErrors", 1, "unitid", "255",
				"dataType", "HoldingRegister", "adr", from, "quantity", quantity,
				"rate", "1", "rateUnit", "s", "delayOnStart", 0, "server", CLIENT,
				"emptyMsgOnFail", 0, "x", 160, "y", 80 + 60 * (int)number, "wires",
				DECODE));
	}
}

void db_ctl_write_node_red(const struct db_ctl_clients *of, FILE *out)
{
	size_t at = 0;
	const char *name;
	const json_t *window = db_ctl_next_of_window(of, 0, &at, &name);
	json_int_t first = window ? db_words_number(window, "address") : 0;
	json_int_t size = window ? window_size(of) : READ_MAX;
	char *decoder = make_decoder(of, first, size);
	char port[16];
	json_t *nodes = json_array();

	snprintf(port, sizeof(port), "%u", of->port);
	(void)json_array_append_new(nodes, json_pack("{s:s, s:s, s:s, s:b, s:s}", "id", FLOW,
	                                             "type", "tab", "label", "drivebridge",
	                                             "disabled", 0, "info", ""));
	(void)json_array_append_new(
		nodes,
		json_pack("{s:s, s:s, s:s, s:s, s:b, s:b, s:s, s:s, s:s, s:s, s:s, s:s, s:b, s:s}",
	                  "id", CLIENT, "type", "modbus-client", "name", "drivebridge",
	                  "clienttype", "tcp", "bufferCommands", 1, "stateLogEnabled", 0, "tcpHost",
	                  of->host, "tcpPort", port, "tcpType", "DEFAULT", "unit_id", "255",
	                  "commandDelay", "1", "clientTimeout", "1000", "reconnectOnTimeout", 1,
	                  "reconnectTimeout", "2000"));
	(void)json_array_append_new(
		nodes, json_pack("{s:s, s:s, s:s, s:s, s:s, s:i, s:i, s:i, s:i, s:[[s]]}", "id",
	                         DECODE, "type", "function", "z", FLOW, "name", "decode", "func",
	                         decoder ? decoder : "", "outputs", 1, "noerr", 0, "x", 380, "y",
	                         80, "wires", SHOW));
	(void)json_array_append_new(nodes,
	                            json_pack("{s:s, s:s, s:s, s:s, s:b, s:b, s:s, s:i, s:i, s:[]}",
	                                      "id", SHOW, "type", "debug", "z", FLOW, "name",
	                                      "drives", "active", 1, "tosidebar", 1, "complete",
	                                      "payload", "x", 560, "y", 80, "wires"));
	add_reads(nodes, json_array_size(of->drives), first, size);
	(void)json_dumpf(nodes, out, JSON_INDENT(2));
	fputc('\n', out);
	json_decref(nodes);
	free(decoder);
}
