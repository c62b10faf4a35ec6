/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/clients_text.h"
#include "ctl/ctl_private.h"
#include "ctl/session.h"

#include "drivebridge/hash.h"

#include <stdint.h>
#include <string.h>

#define HEAD "Written by drivebridgectl export: "

static void put_head(FILE *out, const struct db_ctl_clients *of)
{
	fprintf(out, "# " HEAD "%zu drives of %s\n", json_array_size(of->drives), of->host);
}

/* --- Telegraf --------------------------------------------------------------------------------- */

/* `optimized`: Telegraf reads the gaps too, so that it makes one request. */
static void begin_request(FILE *out, const struct db_ctl_clients *of, const char *measurement,
                          bool optimized)
{
	fprintf(out,
	        "\n  [[inputs.modbus.request]]\n"
	        "    slave_id = %d\n"
	        "    byte_order = \"%s\"\n"
	        "    register = \"holding\"\n"
	        "    measurement = \"%s\"\n",
	        DB_CTL_GATEWAY_UNIT, of->low_word_first ? "CDAB" : "ABCD", measurement);
	if (optimized)
		fputs("    optimization = \"max_insert\"\n"
		      "    optimization_max_register_fill = 50\n",
		      out);
	fputs("    fields = [\n", out);
}

static void put_field(FILE *out, const json_t *reg, const char *name)
{
	fprintf(out, "      { address = %lld, name = \"%s\", type = \"%s\" },\n",
	        json_integer_value(json_object_get(reg, "address")), name,
	        db_ctl_client_type(reg)->telegraf);
}

static void put_figures(FILE *out, const struct db_ctl_clients *of,
                        const struct db_ctl_figure *figures, size_t bus)
{
	for (const struct db_ctl_figure *figure = figures; figure->name; figure++) {
		const json_t *reg = db_ctl_figure(of, figure, bus);

		if (reg)
			put_field(out, reg, figure->name);
	}
}

void db_ctl_write_telegraf(const struct db_ctl_clients *of, FILE *out)
{
	size_t i;
	const json_t *bus;

	put_head(out, of);
	fprintf(out,
	        "# What is told of a drive is read in one request, and so of one moment.\n\n"
	        "[[inputs.modbus]]\n"
	        "  name = \"drivebridge\"\n"
	        "  controller = \"tcp://%s:%u\"\n"
	        "  timeout = \"1s\"\n"
	        "  configuration_type = \"request\"\n",
	        of->host, of->port);
	begin_request(out, of, "drivebridge", true);
	put_figures(out, of, db_ctl_gateway_figures, 0);
	fputs("    ]\n", out);
	json_array_foreach(of->buses, i, bus)
	{
		if (!db_ctl_figure(of, db_ctl_bus_figures, i + 1))
			break; /* only the first buses have figures in registers */
		begin_request(out, of, "drivebridge_bus", true);
		put_figures(out, of, db_ctl_bus_figures, i + 1);
		fputs("    ]\n    [inputs.modbus.request.tags]\n      bus = ", out);
		db_ctl_put_quoted(out, db_words_text(bus, "name"));
		fputc('\n', out);
	}
	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		size_t at = 0;
		const char *name;
		const json_t *reg;

		/* The whole window, also values that nobody keeps: otherwise Telegraf would make
		 * one request before a gap and one after it. */
		begin_request(out, of, "drivebridge_drive", false);
		while ((reg = db_ctl_next_of_window(of, drive, &at, &name)) != NULL)
			put_field(out, reg, name);
		fputs("    ]\n    [inputs.modbus.request.tags]\n      drive = ", out);
		db_ctl_put_quoted(out, db_ctl_drive_name(of, drive));
		fputs("\n      bus = ", out);
		db_ctl_put_quoted(out, db_words_text(json_array_get(of->drives, drive), "bus"));
		fputs("\n      unit_name = ", out);
		db_ctl_put_quoted(out,
		                  db_words_text(json_array_get(of->drives, drive), "unit_name"));
		fputc('\n', out);
	}
}

/* --- Prometheus ------------------------------------------------------------------------------- */

static void put_alert(FILE *out, const char *name, const char *expression, const char *wait,
                      const char *drive, const char *summary)
{
	fprintf(out, "      - alert: %s\n        expr: %s\n", name, expression);
	if (wait)
		fprintf(out, "        for: %s\n", wait);
	if (drive)
		fprintf(out, "        labels: {drive: \"%s\"}\n", drive);
	fprintf(out, "        annotations: {summary: \"%s\"}\n", summary);
}

void db_ctl_write_prometheus(const struct db_ctl_clients *of, FILE *out)
{
	char expression[256];
	char summary[256];

	put_head(out, of);
	fprintf(out,
	        "# Rules for the figures of drivebridge-web (/metrics) or drivebridgectl metrics. "
	        "In prometheus.yml:\n"
	        "#   rule_files: [drivebridge-rules.yml]\n"
	        "#   scrape_configs:\n"
	        "#     - job_name: drivebridge\n"
	        "#       static_configs: [{targets: [\"%s:8080\"]}]\n"
	        "groups:\n"
	        "  - name: drivebridge\n"
	        "    rules:\n",
	        of->host);
	put_alert(out, "DriveDoesNotAnswer", "drivebridge_drive_up == 0", "10s", NULL,
	          "{{ $labels.drive }} does not answer");
	put_alert(out, "DriveInErrorStop", "drivebridge_drive_axis_state == 7", NULL, NULL,
	          "{{ $labels.drive }} is in ErrorStop");
	put_alert(out, "WatchdogStoppedADrive",
	          "increase(drivebridge_watchdog_trips_total[5m]) > 0", NULL, NULL,
	          "{{ $labels.drive }} was stopped by its watchdog");
	put_alert(out, "BusIsTooFull", "rate(drivebridge_bus_overruns_total[5m]) > 0.1", NULL, NULL,
	          "{{ $labels.bus }}: its cycle is too short for its drives");
	put_alert(out, "ServiceDoesNotAnswer", "up{job=\"drivebridge\"} == 0", "1m", NULL,
	          "drivebridge does not answer");
	/* A rule over all drives cannot see one that is missing completely. */
	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		const char *name = db_ctl_drive_name(of, drive);

		snprintf(expression, sizeof(expression),
		         "absent(drivebridge_drive_up{drive=\"%s\"})", name);
		snprintf(summary, sizeof(summary), "nothing is told of %s", name);
		put_alert(out, "DriveIsMissing", expression, "1m", name, summary);
	}
}

/* The first digit of an address is the function; `endianness: big` is ABCD, `yolo` CDAB. */
static void put_metric(FILE *out, const struct db_ctl_clients *of, const char *prefix,
                       const char *name, const json_t *reg, bool counter, const char *label,
                       const char *value)
{
	const struct db_ctl_client_type *type = db_ctl_client_type(reg);
	const char *text = db_words_text(reg, "description");
	const char *colon = label ? strstr(text, ": ") : NULL;

	fprintf(out, "      - name: %s%s\n        help: ", prefix, name);
	/* Drop the number of the bus or drive: one metric has one help text. */
	db_ctl_put_quoted(out, colon ? colon + 2 : label ? name : text);
	fprintf(out,
	        "\n        address: 3%05lld\n        dataType: %s\n        endianness: %s\n"
	        "        metricType: %s\n",
	        json_integer_value(json_object_get(reg, "address")), type->exporter,
	        of->low_word_first && type->registers > 1 ? "yolo" : "big",
	        counter ? "counter" : "gauge");
	if (!label)
		return;
	fprintf(out, "        labels:\n          %s: ", label);
	db_ctl_put_quoted(out, value);
	fputc('\n', out);
}

static void put_metrics(FILE *out, const struct db_ctl_clients *of,
                        const struct db_ctl_figure *figures, size_t bus, const char *name)
{
	for (const struct db_ctl_figure *figure = figures; figure->name; figure++) {
		const json_t *reg = db_ctl_figure(of, figure, bus);

		if (reg)
			put_metric(out, of, bus > 0 ? "drivebridge_bus_" : "drivebridge_",
			           figure->name, reg, figure->counter, bus > 0 ? "bus" : NULL,
			           name);
	}
}

void db_ctl_write_modbus_exporter(const struct db_ctl_clients *of, FILE *out)
{
	size_t i;
	const json_t *bus;

	put_head(out, of);
	fprintf(out,
	        "# Scrape it with module=drivebridge, sub_target=%d and target=%s:%u.\nmodules:\n"
	        "  - name: drivebridge\n    protocol: tcp/ip\n    metrics:\n",
	        DB_CTL_GATEWAY_UNIT, of->host, of->port);
	put_metrics(out, of, db_ctl_gateway_figures, 0, NULL);
	json_array_foreach(of->buses, i, bus)
		put_metrics(out, of, db_ctl_bus_figures, i + 1, db_words_text(bus, "name"));
	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		size_t at = 0;
		const char *name;
		const json_t *reg;

		while ((reg = db_ctl_next_of_window(of, drive, &at, &name)) != NULL)
			put_metric(out, of, "drivebridge_drive_", name, reg, false, "drive",
			           db_ctl_drive_name(of, drive));
	}
}

/* --- Zabbix ----------------------------------------------------------------------------------- */

static uint64_t add_to_hash(uint64_t hash, const char *text)
{
	return db_hash_add(hash, text, strlen(text));
}

/* In the form of a random UUID, but constant for one template and item, so that another import
 * replaces items and doubles none. */
static void put_uuid(FILE *out, const char *before, const struct db_ctl_clients *of,
                     const char *kind, const char *drive, const char *name)
{
	static const uint64_t seeds[2] = { DB_HASH_BEGIN, UINT64_C(7809847782465536322) };
	uint64_t half[2];

	for (size_t i = 0; i < 2; i++) {
		half[i] = seeds[i];
		half[i] = add_to_hash(half[i], of->host);
		half[i] = add_to_hash(add_to_hash(half[i], "/"), kind);
		half[i] = add_to_hash(add_to_hash(half[i], "/"), drive);
		half[i] = add_to_hash(add_to_hash(half[i], "/"), name);
	}
	half[0] = (half[0] & ~UINT64_C(0xf000)) | UINT64_C(0x4000);
	half[1] = (half[1] & ~(UINT64_C(0xc) << 60)) | (UINT64_C(8) << 60);
	fprintf(out, "%suuid: %016llx%016llx\n", before, (unsigned long long)half[0],
	        (unsigned long long)half[1]);
}

static void put_template(FILE *out, const struct db_ctl_clients *of)
{
	char text[300];

	snprintf(text, sizeof(text), "drivebridge %s", of->host);
	/* The technical name may not contain the colons and brackets of IPv6 addresses. */
	for (char *at = text; *at; at++)
		*at = strchr(":[]", *at) ? '-' : *at;
	fputs(text, out);
}

static void put_trigger(FILE *out, const struct db_ctl_clients *of, const char *drive,
                        const char *key, const char *condition, const char *text)
{
	char name[128];

	snprintf(name, sizeof(name), "%s %s", drive, text);
	put_uuid(out, "            - ", of, "trigger", drive, text);
	fputs("              expression: 'last(/", out);
	put_template(out, of);
	fprintf(out, "/%s)%s'\n              name: ", key, condition);
	db_ctl_put_quoted(out, name);
	fputs("\n              priority: HIGH\n", out);
}

/* `drive`: its name, or the bus's, or "gateway". */
static void put_item(FILE *out, const struct db_ctl_clients *of, const char *drive,
                     const char *name, const json_t *reg, const char *unit, bool is_drive)
{
	const struct db_ctl_client_type *type = db_ctl_client_type(reg);
	const char *kind = db_words_text(reg, "type");
	char key[128];
	char text[256];

	snprintf(key, sizeof(key), "modbus.get[{$DRIVEBRIDGE.URL},%d,3,%lld,1,%s%s]",
	         DB_CTL_GATEWAY_UNIT, json_integer_value(json_object_get(reg, "address")),
	         type->zabbix, of->low_word_first && type->registers > 1 ? ",mle" : "");
	put_uuid(out, "        - ", of, "item", drive, name);
	snprintf(text, sizeof(text), "%s %s", drive, name);
	fputs("          name: ", out);
	db_ctl_put_quoted(out, text);
	fprintf(out, "\n          key: '%s'\n          delay: 10s\n          history: 31d\n", key);
	if (kind[0] == 'i' || kind[0] == 'f')
		fputs("          value_type: FLOAT\n", out);
	if (unit[0] != '\0') {
		/* "!" keeps Zabbix from adding a prefix such as kilo. */
		snprintf(text, sizeof(text), "!%s", unit);
		fputs("          units: ", out);
		db_ctl_put_quoted(out, text);
		fputc('\n', out);
	}
	fputs("          description: ", out);
	db_ctl_put_quoted(out, db_words_text(reg, "description"));
	fputc('\n', out);
	if (is_drive && strcmp(name, "online") == 0) {
		fputs("          triggers:\n", out);
		put_trigger(out, of, drive, key, "=0", "does not answer");
	} else if (is_drive && strcmp(name, "axis_state") == 0) {
		fputs("          triggers:\n", out);
		put_trigger(out, of, drive, key, "=7", "is in ErrorStop");
	}
}

static void put_items(FILE *out, const struct db_ctl_clients *of,
                      const struct db_ctl_figure *figures, size_t bus, const char *name)
{
	for (const struct db_ctl_figure *figure = figures; figure->name; figure++) {
		const json_t *reg = db_ctl_figure(of, figure, bus);

		if (reg)
			put_item(out, of, name, figure->name, reg, db_ctl_unit_of(reg), false);
	}
}

void db_ctl_write_zabbix(const struct db_ctl_clients *of, FILE *out)
{
	size_t i;
	const json_t *bus;

	put_head(out, of);
	fputs("zabbix_export:\n  version: '6.0'\n  groups:\n", out);
	/* For all gateways. */
	fputs("    - uuid: 8c9c16f4a1f14c2b9d3f5a7e60b1d2c4\n      name: Templates/Drives\n  "
	      "templates:\n",
	      out);
	put_uuid(out, "    - ", of, "template", "", "");
	fputs("      template: ", out);
	put_template(out, of);
	fputs("\n      name: ", out);
	put_template(out, of);
	fputs("\n      description: Drives behind drivebridge, read by Zabbix agent 2 over Modbus "
	      "TCP\n"
	      "      groups:\n        - name: Templates/Drives\n      items:\n",
	      out);
	put_items(out, of, db_ctl_gateway_figures, 0, "gateway");
	json_array_foreach(of->buses, i, bus)
	{
		char name[128];

		snprintf(name, sizeof(name), "bus %s", db_words_text(bus, "name"));
		put_items(out, of, db_ctl_bus_figures, i + 1, name);
	}
	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		size_t at = 0;
		const char *name;
		const json_t *reg;

		while ((reg = db_ctl_next_of_window(of, drive, &at, &name)) != NULL)
			put_item(out, of, db_ctl_drive_name(of, drive), name, reg,
			         db_ctl_unit_of(db_ctl_drive_register(of, drive, name)), true);
	}
	fprintf(out,
	        "      macros:\n        - macro: '{$DRIVEBRIDGE.URL}'\n"
	        "          value: 'tcp://%s:%u'\n",
	        of->host, of->port);
}
