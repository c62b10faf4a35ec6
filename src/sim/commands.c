/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/commands.h"

#include "sim/family.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

struct request {
	struct sim_world *world;
	struct sim_node *node; /* the drive named by the first argument, or null */
	struct sim_bus *bus;   /* the bus of that name, or null */
	char *rest;            /* the text after the name, "" without one */
	db_time now;
	FILE *out;
};

/* Null, or the mistake. A handler that answers itself writes its own "ok" line and returns "". */
typedef const char *command_fn(struct request *request);

enum target { TARGET_NONE, TARGET_DRIVE, TARGET_BUS, TARGET_ANY };

#define NOT_OF_FAMILY "this family has none"

static const char *do_fault(struct request *request)
{
	return sim_world_fault(request->node, request->bus, request->rest, request->now);
}

static const char *do_flash(struct request *request)
{
	struct sim_node *node = request->node;

	if (!node->flash_fails)
		return NOT_OF_FAMILY;
	if (strcmp(request->rest, "fail") != 0 && strcmp(request->rest, "ok") != 0)
		return "flash needs \"fail\" or \"ok\"";
	*node->flash_fails = request->rest[0] == 'f';
	return NULL;
}

static const char *do_stall(struct request *request)
{
	struct sim_node *node = request->node;
	bool off = strcmp(request->rest, "off") == 0;

	if (!node->stalled)
		return NOT_OF_FAMILY;
	if (!off && request->rest[0] != '\0' && strcmp(request->rest, "on") != 0)
		return "stall needs \"on\", \"off\" or nothing";
	node->family->advance(node, request->now);
	*node->stalled = !off;
	return NULL;
}

static const char *do_power(struct request *request)
{
	struct sim_node *node = request->node;
	bool cycle = strcmp(request->rest, "cycle") == 0;
	bool on = strcmp(request->rest, "on") == 0;

	if (!cycle && !on && strcmp(request->rest, "off") != 0)
		return "power needs \"on\", \"off\" or \"cycle\"";
	if (!on)
		node->family->power(node, false, request->now);
	if (on || cycle)
		node->family->power(node, true, request->now);
	sim_world_report(request->world, node,
	                 cycle ? "power cycle" :
	                 on    ? "power on" :
	                         "power off",
	                 request->now);
	return NULL;
}

/* Two drives may have the same address: that is the purpose. */
static const char *do_address(struct request *request)
{
	char *end;
	unsigned long address = strtoul(request->rest, &end, 10);

	if (end == request->rest || *end != '\0' || address < 1 || address > 31)
		return "address needs a number, 1 to 31";
	request->node->family->set_address(request->node, (unsigned)address);
	return NULL;
}

static const char *do_bits(struct request *request)
{
	char *end;
	unsigned long mask = strtoul(request->rest, &end, 0);
	struct sim_node *node = request->node;

	if (!node->forced_status)
		return NOT_OF_FAMILY;
	if (end == request->rest || *end != '\0' || mask > UINT32_MAX)
		return "bits needs a number, 0x40 for instance";
	*node->forced_status = (uint32_t)mask;
	return NULL;
}

static const char *do_baud(struct request *request)
{
	char *end;
	unsigned long baud = strtoul(request->rest, &end, 10);
	struct sim_serial_bus *line = request->bus->wire;

	if (!sim_families[request->bus->config->kind]->protocol || request->bus->config->replay)
		return "baud is for serial lines";
	if (end == request->rest || *end != '\0' || baud < 2400 || baud > 921600)
		return "baud needs a rate of 2400 to 921600";
	line->config.baud = (unsigned)baud;
	return NULL;
}

static const char *do_get(struct request *request)
{
	struct sim_node *node = request->node;
	char text[256];

	fputs("ok", request->out);
	if (node) {
		node->family->write_state(node, request->now, request->out);
	} else {
		request->bus->ops->describe(request->bus->wire, text, sizeof(text));
		fprintf(request->out, " device=%s %s", request->bus->port.host, text);
	}
	fputc('\n', request->out);
	return "";
}

static const char *do_log(struct request *request)
{
	const struct sim_node *node = request->node;
	uint32_t first = node->received > SIM_LOG_LINES ? node->received - SIM_LOG_LINES : 0;

	for (uint32_t i = first; i < node->received; i++) {
		const struct sim_log_entry *entry = &node->log[i % SIM_LOG_LINES];

		fprintf(request->out, "%" PRId64 " %s\n", entry->time / DB_NS_PER_US, entry->line);
	}
	return NULL;
}

static const char *do_list(struct request *request)
{
	const struct sim_world *world = request->world;

	for (size_t i = 0; i < world->bus_count; i++)
		fprintf(request->out, "bus %s %s\n", world->buses[i].config->name,
		        world->buses[i].port.host);
	for (size_t i = 0; i < world->node_count; i++) {
		const struct sim_node *node = &world->nodes[i];

		fprintf(request->out, "drive %s %u\n", node->name, node->family->get_address(node));
	}
	return NULL;
}

static const struct {
	const char *name;
	enum target target;
	command_fn *run;
} commands[] = {
	{ "fault", TARGET_ANY, do_fault },       { "power", TARGET_DRIVE, do_power },
	{ "address", TARGET_DRIVE, do_address }, { "flash", TARGET_DRIVE, do_flash },
	{ "stall", TARGET_DRIVE, do_stall },     { "bits", TARGET_DRIVE, do_bits },
	{ "baud", TARGET_BUS, do_baud },         { "get", TARGET_ANY, do_get },
	{ "log", TARGET_DRIVE, do_log },         { "list", TARGET_NONE, do_list },
};

#define COMMAND_COUNT (sizeof(commands) / sizeof(commands[0]))

/* Cuts the first word off a text; *rest is what follows it. */
static char *cut_word(char *text, char **rest)
{
	char *word = text + strspn(text, " \t");
	char *end = word + strcspn(word, " \t");

	*rest = end + strspn(end, " \t");
	*end = '\0';
	return word;
}

static const char *find_target(struct request *request, enum target target)
{
	struct sim_world *world = request->world;
	const char *name;

	if (target == TARGET_NONE)
		return NULL;
	name = cut_word(request->rest, &request->rest);
	for (size_t i = 0; target != TARGET_BUS && i < world->node_count && !request->node; i++) {
		if (strcmp(world->nodes[i].name, name) == 0)
			request->node = &world->nodes[i];
	}
	for (size_t i = 0; target != TARGET_DRIVE && i < world->bus_count && !request->bus; i++) {
		if (strcmp(world->buses[i].config->name, name) == 0)
			request->bus = &world->buses[i];
	}
	if (!request->node && !request->bus)
		return target == TARGET_BUS ? "no such bus" :
		       target == TARGET_ANY ? "no such drive or bus" :
		                              "no such drive";
	return NULL;
}

static const struct sim_family_command *find_own(const struct sim_family *family, const char *name)
{
	for (const struct sim_family_command *own = family->commands; own->name; own++) {
		if (strcmp(own->name, name) == 0)
			return own;
	}
	return NULL;
}

void sim_command(struct sim_world *world, char *line, db_time now, FILE *out)
{
	struct request request = { .world = world, .now = now, .out = out };
	const char *name = cut_word(line, &request.rest);
	const struct sim_family_command *own = NULL;
	const char *error;
	size_t i = 0;

	while (i < COMMAND_COUNT && strcmp(name, commands[i].name) != 0)
		i++;
	if (i < COMMAND_COUNT) {
		error = find_target(&request, commands[i].target);
		if (!error)
			error = commands[i].run(&request);
	} else {
		/* A command that only some families have. */
		for (size_t k = 0; k < SIM_BUS_KINDS && !own; k++)
			own = find_own(sim_families[k], name);
		error = own ? find_target(&request, TARGET_DRIVE) :
		              "no such command; there are fault, power, address, identity, flash, "
		              "stall, sensor, bits, param, params, faults, health, inputs, "
		              "reports, input, item, place, baud, get, log, list";
		if (!error) {
			own = find_own(request.node->family, name);
			error = own ? own->run(request.node, request.rest, now) : NOT_OF_FAMILY;
		}
	}
	if (!error)
		fputs("ok\n", out);
	else if (error[0] != '\0')
		fprintf(out, "error %s\n", error);
}
