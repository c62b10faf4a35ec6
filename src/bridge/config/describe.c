/* SPDX-License-Identifier: Apache-2.0 */
#include "config/bounds.h"
#include "config/keys.h"
#include "config/text.h"
#include "config/times.h"
#include "drivebridge/command_table.h"
#include "drivebridge/driver.h"
#include "drivebridge/scale.h"
#include "drivebridge/transport.h"

#include <math.h>
#include <string.h>

/* The word at a position of a key's list, as it is written in a file. */
static void put_word(FILE *out, const char *section, const char *key, unsigned position)
{
	db_text_put_word(out, db_keys_find(section, key)->words, position);
}

static void put_log(FILE *out, const char *section, enum db_log_level level)
{
	fprintf(out, "  %-14s", "log");
	put_word(out, section, "log", (unsigned)level - db_keys_find(section, "log")->first);
	fprintf(out, "\n");
}

static void put_networks(FILE *out, const char *what, const struct db_network *networks,
                         size_t count)
{
	static const struct db_network nobody = { .prefix = 128 };

	fprintf(out, "  %-14s", what);
	for (size_t i = 0; i < count; i++) {
		char text[DB_NETWORK_TEXT_MAX];

		if (networks[i].prefix == nobody.prefix &&
		    memcmp(networks[i].address, nobody.address, sizeof(nobody.address)) == 0)
			snprintf(text, sizeof(text), "nobody");
		else
			db_text_of_network(&networks[i], text);
		fprintf(out, "%s%s", i > 0 ? ", " : "", text);
	}
	fprintf(out, "\n");
}

static void put_drives(FILE *out, const char *what, const struct db_drive_set *set)
{
	fprintf(out, "%s%s", what, set->all ? " all drives" : set->names ? "" : " no drive");
	for (const char *name = set->names; name && *name; name += strlen(name) + 1)
		fprintf(out, " %s", name);
}

/* Who comes over TLS, and who must. */
static void describe_secure(const struct db_modbus_config *modbus, FILE *out)
{
	static const char *const needed[] = {
		[DB_SECURE_NOT_REQUIRED] = "for nothing",
		[DB_SECURE_FOR_WRITES] = "to write, from the network",
		[DB_SECURE_FOR_ALL] = "to connect, from the network",
	};

	fprintf(out, "  %-14s%s; needed %s\n", "certificates",
	        strcmp(modbus->secure_socket, DB_NO_SOCKET) == 0 ? "not taken" :
	                                                           modbus->secure_socket,
	        needed[modbus->require_secure]);
	for (size_t i = 0; i < modbus->role_count; i++) {
		const struct db_role_config *role = &modbus->roles[i];

		fprintf(out, "  %-14s%s:", i == 0 ? "roles" : "", role->name);
		put_drives(out, " reads", &role->read);
		put_drives(out, ", writes", &role->write);
		fprintf(out, "%s%s\n", role->parameters ? ", parameters" : "",
		        role->control ? ", control" : "");
	}
}

static void put_limit(FILE *out, unsigned limit)
{
	if (limit > 0)
		fprintf(out, "%u", limit);
	else
		fprintf(out, "any number of");
}

static void describe_modbus(const struct db_config *config, FILE *out)
{
	const struct db_modbus_config *modbus = &config->modbus;

	fprintf(out, "modbus\n  %-14s%s\n", "listen", modbus->listen);
	put_networks(out, "allow-read", modbus->allow_read, modbus->allow_read_count);
	put_networks(out, "allow-write", modbus->allow_write, modbus->allow_write_count);
	if (modbus->everybody_writes_here)
		fprintf(out, "  %-14swhoever runs here may write\n", "this machine");
	else
		fprintf(out, "  %-14sroot, this service's user, group %s may write\n",
		        "this machine", config->control.act_group);
	describe_secure(modbus, out);
	fprintf(out, "  %-14s0, 255", "gateway unit");
	if (modbus->gateway_unit > 0)
		fprintf(out, ", %u", modbus->gateway_unit);
	fprintf(out, "\n  %-14s", "word-order");
	put_word(out, "modbus", "word-order", modbus->low_word_first);
	fprintf(out, "\n  %-14s", "writes");
	if (modbus->accept_writes)
		fprintf(out, "answered as soon as they are queued\n");
	else
		fprintf(out, "answered when confirmed, or with exception 05 after %u ms\n",
		        modbus->confirm_ms);
	fprintf(out, "  %-14s", "stale data");
	put_word(out, "modbus", "stale", modbus->stale_values);
	fprintf(out, "\n");
	/* What prevents one client from using the resources of others. */
	fprintf(out, "  %-14s%u clients (%u of them only writers), %u requests of each at once\n",
	        "limits", modbus->max_clients, modbus->reserved_writers, modbus->max_pipelined);
	fprintf(out, "  %-14s", "per address");
	put_limit(out, modbus->max_clients_per_address);
	fprintf(out, " clients, ");
	put_limit(out, modbus->max_requests_per_second);
	fprintf(out, " requests per second\n");
	fprintf(out, "  %-14sone memory per ", "command_id");
	put_word(out, "modbus", "command-id-scope", modbus->command_id_scope);
	fprintf(out, "\n  %-14s", "control");
	put_word(out, "modbus", "control", modbus->control);
	if (modbus->control != DB_CONTROL_OFF)
		fprintf(out, ", lost after %u ms of silence", modbus->control_timeout_ms);
	fprintf(out, "\n");
	put_log(out, "modbus", modbus->log);
	fprintf(out, "  %-14sunfinished frame %u ms, idle ", "timeouts", modbus->frame_timeout_ms);
	if (modbus->idle_timeout_s > 0)
		fprintf(out, "%u s\n", modbus->idle_timeout_s);
	else
		fprintf(out, "never\n");
}

static void describe_endpoint(const struct db_endpoint_config *endpoint, FILE *out)
{
	fprintf(out, "endpoint %s\n  %-14s%s\n", endpoint->name, "listen", endpoint->listen);
	put_networks(out, "allow-read", endpoint->allow_read, endpoint->allow_read_count);
	put_networks(out, "allow-write", endpoint->allow_write, endpoint->allow_write_count);
	if (strcmp(endpoint->secure_socket, DB_NO_SOCKET) != 0)
		fprintf(out, "  %-14s%s\n", "certificates", endpoint->secure_socket);
	fprintf(out, "  %-14s0, 255", "gateway unit");
	if (endpoint->gateway_unit > 0)
		fprintf(out, ", %u", endpoint->gateway_unit);
	fprintf(out, "\n  %-14s%u clients of its own (%u of them only writers)\n", "limits",
	        endpoint->max_clients, endpoint->reserved_writers);
}

/* The family's own settings of this kind of section, separated by commas. `before` comes first. */
static bool put_options(FILE *out, const char *section, const struct db_driver *driver,
                        const void *options, const char *before)
{
	bool any = false;

	for (size_t i = 0; i < driver->option_count; i++) {
		const struct db_option *option = &driver->options[i];
		double value;

		if (strcmp(option->section, section) != 0)
			continue;
		value = db_option_value(option, options);
		fprintf(out, "%s%s ", any ? ", " : before, option->name);
		any = true;
		if (isnan(value))
			fprintf(out, "not set");
		else if (option->words[0] != '\0')
			db_text_put_word(out, option->words, (unsigned)value);
		else if (option->whole && db_text_is_hex(option->preset))
			fprintf(out, "0x%X", (unsigned)value);
		else
			fprintf(out, "%.10g%s%s", value, option->unit[0] ? " " : "", option->unit);
	}
	return any;
}

static void describe_bounds(const struct db_config *config, size_t index, FILE *out)
{
	const struct db_bus_config *bus = &config->buses[index];
	struct db_load_of_bus load = {
		.nodes = db_times_nodes_on(config, index),
		.drives = db_times_drives_on(config, index),
		.moving = 1,
	};
	struct db_bounds one;
	struct db_bounds busy;
	struct db_bounds all;

	if (load.nodes == 0)
		return;
	db_bounds_of(bus, &load, &one);
	load.busy = true;
	db_bounds_of(bus, &load, &busy);
	load.moving = load.nodes;
	db_bounds_of(bus, &load, &all);
	fprintf(out, "  %-14sa stop is on the wire after at most %.1f ms", "bounds",
	        db_times_in_ms(one.stop));
	if (one.hearing > 0)
		fprintf(out, ", %.1f ms where drives hear late after their answers",
		        db_times_in_ms(one.stop + one.hearing));
	if (one.unanswered > 0)
		fprintf(out, ", and %.1f ms more where the exchange under way is not answered",
		        db_times_in_ms(one.unanswered));
	fprintf(out, "\n  %-14sa position is at most %.1f ms old while its drive moves", "",
	        db_times_in_ms(one.moving));
	if (one.standing > 0)
		fprintf(out,
		        ", %.1f ms while it stands and one other moves\n"
		        "  %-14swhile everything else wants the bus as well: %.1f ms, %.1f ms; "
		        "and %.1f ms while all move",
		        db_times_in_ms(one.standing), "", db_times_in_ms(busy.moving),
		        db_times_in_ms(busy.standing), db_times_in_ms(all.moving));
	fprintf(out, "\n  %-14sa parameter is written within %.1f ms\n", "",
	        db_times_in_ms(one.parameter));
}

/* What the family can do, except with this configuration. */
static void describe_forbidden(const struct db_bus_config *bus, const struct db_drive_config *drive,
                               FILE *out)
{
	uint64_t forbidden = bus->driver->commands & ~db_driver_commands(bus, drive);
	const char *before = "";

	if (forbidden == 0)
		return;
	fprintf(out, "    refused with these settings: ");
	for (unsigned code = 0; code < DB_CMD_LIMIT; code++) {
		if (!(forbidden & DB_COMMAND_BIT(code)))
			continue;
		fprintf(out, "%s%s", before, db_command_name(code));
		before = ", ";
	}
	fprintf(out, "\n");
}

static void describe_drive(const struct db_config *config, size_t index, FILE *out)
{
	const struct db_drive_config *drive = &config->drives[index];
	const struct db_bus_config *bus = &config->buses[drive->bus];
	const struct db_profile_use *profile = db_config_find_profile(config, true, index);

	fprintf(out, "  drive %s: ", drive->name);
	if (drive->endpoint_name)
		fprintf(out, "endpoint %s, ", drive->endpoint_name);
	fprintf(out, "unit %u", drive->unit);
	if (drive->address > 0)
		fprintf(out, ", address %u", drive->address);
	if (bus->driver->axes > 0) {
		fprintf(out, ", axis ");
		put_word(out, "drive", "axis", drive->axis);
	}
	if (drive->vendor_layout || drive->vendor_unit != 0) {
		if (drive->vendor_layout)
			fprintf(out, ", layout ");
		else
			fprintf(out, ", vendor-unit %u with layout ", drive->vendor_unit);
		put_word(out, "drive", "layout", true);
		fprintf(out, ", ");
		put_word(out, "drive", "vendor-word-order", drive->vendor_high_first);
	}
	if (bus->driver->scale_unit && !drive->counts_given)
		fprintf(out, ", counts per %s from the drive, on-client-loss ",
		        db_scale_unit(bus->driver, drive));
	else
		fprintf(out, ", %g counts per %s, on-client-loss ", drive->counts_per_unit,
		        drive->unit_name);
	put_word(out, "drive", "on-client-loss", drive->on_client_loss);
	fprintf(out, ", on-exit ");
	put_word(out, "drive", "on-exit", drive->on_exit);
	fprintf(out, ", on-stop-failure ");
	put_word(out, "drive", "on-stop-failure", drive->on_stop_failure);
	if (drive->watchdog_ms > 0)
		fprintf(out, ", watchdog %u ms", drive->watchdog_ms);
	else
		fprintf(out, ", watchdog off");
	/* The register watchdog_ms may turn it on. */
	fprintf(out, ", fed by ");
	put_word(out, "drive", "watchdog-feed", drive->watchdog_feed);
	put_options(out, "drive", bus->driver, drive->options, ", ");
	fprintf(out, "\n");
	if (profile)
		fprintf(out, "    from profile %s: %s\n", profile->path, profile->keys);
	describe_forbidden(bus, drive, out);
}

static void describe_line(const struct db_bus_config *bus, FILE *out)
{
	const char *name = bus->transport->name;

	if (bus->transport->uses_interface) {
		fprintf(out, "  %-14s%s, %s, %u bit/s\n", "interface", bus->interface, name,
		        bus->bitrate);
		return;
	}
	if (bus->driver->medium == DB_MEDIUM_CAN) {
		fprintf(out, "  %-14s%s, %s, %u bit/s, adapter at %u baud\n", "device", bus->device,
		        name, bus->bitrate, bus->baud);
		return;
	}
	fprintf(out, "  %-14s%s, %s, ", "device", bus->device, name);
	put_word(out, "bus", "line", bus->line);
	fprintf(out, ", %u baud, parity ", bus->baud);
	put_word(out, "bus", "parity", bus->parity);
	fprintf(out, ", %u stop bit%s, turnaround %u us", bus->stop_bits,
	        bus->stop_bits == 1 ? "" : "s", bus->turnaround_us);
	if (bus->direction != DB_DIRECTION_ADAPTER) {
		fputs(", direction ", out);
		put_word(out, "bus", "direction", bus->direction);
		fprintf(out, " (%u ms before, %u ms after)", bus->rts_before_ms, bus->rts_after_ms);
	}
	fputs("\n", out);
}

static void describe_bus(const struct db_config *config, size_t index, FILE *out)
{
	const struct db_bus_config *bus = &config->buses[index];
	const struct db_profile_use *profile = db_config_find_profile(config, false, index);
	char text[DB_CPUS_TEXT_MAX];
	size_t nodes;
	double all;
	double one;

	fprintf(out, "bus %s\n  %-14s%s (%s)\n", bus->name, "protocol", bus->driver->name,
	        bus->driver->title);
	if (profile)
		fprintf(out, "  %-14s%s: %s\n", "profile", profile->path, profile->keys);
	describe_line(bus, out);
	nodes = db_times_nodes_on(config, index);
	all = db_times_in_ms(db_driver_round_time(bus, nodes, db_times_drives_on(config, index)));
	one = nodes > 0 ? all / (double)nodes : db_times_in_ms(bus->driver->poll_time(bus));
	fprintf(out, "  %-14s%u ms; one status exchange %.2f ms, %zu %s%s %.2f ms (%.0f %%)\n",
	        "cycle", bus->cycle_ms, one, nodes, bus->driver->axes > 0 ? "controller" : "drive",
	        nodes == 1 ? "" : "s", all, 100.0 * all / bus->cycle_ms);
	fprintf(out, "  %-14sconfirmed after %.2f ms, or %.2f ms when the wire is busy\n",
	        "command", db_times_in_ms(bus->driver->command_time(bus)),
	        db_times_in_ms(db_times_confirm(bus)));
	describe_bounds(config, index, out);
	fprintf(out, "  %-14sdrive latency %u ms, retries %u, queue %u, save-interval %u s, ",
	        "limits", bus->drive_latency_ms, bus->retries, bus->queue, bus->save_interval_s);
	if (bus->priority > 0)
		fprintf(out, "real-time priority %u", bus->priority);
	else
		fprintf(out, "no real-time priority");
	db_text_of_cpus(bus->cpus, text);
	if (bus->cpus != 0)
		fprintf(out, ", processors %s\n", text);
	else
		fprintf(out, ", any processor\n");
	put_log(out, "bus", bus->log);
	if (put_options(out, "bus", bus->driver, bus->options, "  options       "))
		fprintf(out, "\n");
	for (size_t i = 0; i < config->drive_count; i++) {
		if (config->drives[i].bus == index)
			describe_drive(config, i, out);
	}
}

static void describe_plc(const struct db_config *config, const struct db_rtu_config *line,
                         FILE *out)
{
	char units[DB_UNITS_TEXT_MAX];

	db_text_of_units(line->units, "", units);
	fprintf(out, "modbus-rtu %s\n  %-14s%s, %u baud, 8", line->name, "port", line->device,
	        line->baud);
	fprintf(out, "%c%u, direction ", "NEO"[line->parity], line -> stop_bits);
	put_word(out, "modbus-rtu", "direction", line->direction);
	if (line->direction != DB_DIRECTION_ADAPTER)
		fprintf(out, " (%u ms before, %u ms after)", line->rts_before_ms,
		        line->rts_after_ms);
	fprintf(out, "\n  %-14s%s%s%s\n", "units",
	        strcmp(units, DB_UNITS_ALL) == 0 ? "of every drive, and gateway-unit" : units,
	        line->endpoint_name ? ", of endpoint " : "",
	        line->endpoint_name ? line->endpoint_name : "");
	fprintf(out, "  %-14s%s%s%s\n", "its PLC",
	        line->may_write ? "reads and writes" : "only reads", line->role ? ", as role " : "",
	        line->role ? line->role->name : "");
	fprintf(out, "  %-14safter %.0f ms at the latest, none after %u ms\n", "answers",
	        config->modbus.confirm_ms + db_times_in_ms(db_times_of_line(line)),
	        line->answer_timeout_ms);
	fprintf(out,
	        "  %-14sa stop is carried out for every drive of the units, all else ignored\n",
	        "broadcasts");
	put_log(out, "modbus-rtu", line->log);
}

void db_config_describe(const struct db_config *config, FILE *out)
{
	describe_modbus(config, out);
	for (size_t i = 0; i < config->modbus.endpoint_count; i++)
		describe_endpoint(&config->modbus.endpoints[i], out);
	fprintf(out, "control\n  %-14s%s\n", "socket", config->control.socket);
	if (strcmp(config->control.socket, DB_NO_SOCKET) != 0) {
		fprintf(out, "  %-14s%s%s\n", "read",
		        strcmp(config->control.read_group, DB_EVERYBODY) == 0 ? "" : "group ",
		        config->control.read_group);
		fprintf(out, "  %-14sroot, this service's user, group %s\n", "act",
		        config->control.act_group);
	}
	if (config->control.audit_off)
		fprintf(out, "  %-14soff\n", "audit trail");
	else
		fprintf(out, "  %-14s%u MiB of files at most\n", "audit trail",
		        config->control.audit_mib);
	for (size_t i = 0; i < config->modbus.line_count; i++)
		describe_plc(config, &config->modbus.lines[i], out);
	if (config->control.edit)
		fprintf(out, "  %-14sbuses and drives, over the page and this socket\n", "edit");
	if (config->control.health_off)
		fprintf(out, "  %-14soff\n", "health");
	for (size_t i = 0; i < config->bus_count; i++)
		describe_bus(config, i, out);
	if (config->drive_count == 0)
		fprintf(out, "no drives\n");
}
