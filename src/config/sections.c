/* SPDX-License-Identifier: Apache-2.0 */
/* From the sections of a file to the structs of the configuration. */
#include "config/load.h"

#include <stdlib.h>
#include <string.h>

struct db_section db_section_open(struct db_load *load, const char *name, unsigned index)
{
	struct db_section section = { .load = load, .name = name, .title = "" };

	section.values = cfg_getnsec(load->root, name, index);
	if (section.values && cfg_title(section.values))
		section.title = cfg_title(section.values);
	section.place = db_outline_section_find(&load->outline, name, section.title);
	if (section.place != DB_OUTLINE_TOP)
		section.line = load->outline.sections[section.place].line;
	return section;
}

/* Readers need a place, too; writers can take every one. */
static unsigned read_reserved(const struct db_section *section, unsigned max_clients)
{
	unsigned reserved = db_section_number(section, "reserved-writers");

	if (max_clients == 0 || reserved < max_clients)
		return reserved;
	if (db_section_has(section, "reserved-writers"))
		db_report_error(
			&section->load->report, db_section_line(section, "reserved-writers"),
			"reserved-writers = %u leaves none of max-clients = %u to clients that may only read; fewer than that",
			reserved, max_clients);
	return max_clients - 1;
}

static void read_modbus(struct db_load *load)
{
	struct db_modbus_config *modbus = &load->config->modbus;
	struct db_section section = db_section_open(load, "modbus", 0);

	modbus->listen = db_section_text(&section, "listen");
	modbus->allow_read = db_section_networks(&section, "allow-read", &modbus->allow_read_count);
	modbus->allow_write = db_section_networks(&section, "allow-write",
	                                          &modbus->allow_write_count);
	modbus->low_word_first = db_section_word(&section, "word-order") != 0;
	modbus->confirm_ms = db_section_number(&section, "confirm-ms");
	modbus->accept_writes = db_section_word(&section, "write-confirm") != 0;
	modbus->stale_values = db_section_word(&section, "stale") != 0;
	modbus->gateway_unit = db_section_number(&section, "gateway-unit");
	modbus->max_clients = db_section_number(&section, "max-clients");
	modbus->max_pipelined = db_section_number(&section, "max-pipelined");
	modbus->frame_timeout_ms = db_section_number(&section, "frame-timeout-ms");
	modbus->idle_timeout_s = db_section_number(&section, "idle-timeout-s");
	modbus->keepalive_s = db_section_number(&section, "keepalive-s");
	modbus->reserved_writers = read_reserved(&section, modbus->max_clients);
	modbus->max_clients_per_address = db_section_number(&section, "max-clients-per-address");
	modbus->max_requests_per_second = db_section_number(&section, "max-requests-per-second");
	modbus->command_id_scope = (enum db_id_scope)db_section_word(&section, "command-id-scope");
	modbus->control = (enum db_control_mode)db_section_word(&section, "control");
	modbus->control_timeout_ms = db_section_number(&section, "control-timeout-ms");
	modbus->log = (enum db_log_level)(DB_LOG_ERROR + db_section_word(&section, "log"));
}

bool db_load_sections(struct db_load *load)
{
	struct db_config *config = load->config;
	unsigned buses = cfg_size(load->root, "bus");
	unsigned drives = cfg_size(load->root, "drive");

	/* One more than needed: calloc() of nothing may give null. What is missing here to gcc's analyzer
	 * is freed by db_config_free(). */
	config->buses = calloc((size_t)buses + 1, sizeof(*config->buses));
	config->drives = calloc((size_t)drives + 1, sizeof(*config->drives));
	if (!config->buses || !config->drives)
		return false;
	read_modbus(load);
	config->bus_count = buses;
	for (unsigned i = 0; i < buses; i++) {
		db_load_bus(load, i, &config->buses[i]);
		if (!config->buses[i].name)
			return false;
	}
	config->drive_count = drives;
	for (unsigned i = 0; i < drives; i++) {
		db_load_drive(load, i, &config->drives[i]);
		if (!config->drives[i].name || !config->drives[i].options)
			return false;
	}
	return true;
}
