/* SPDX-License-Identifier: Apache-2.0 */
#include "service/status.h"

#include "service/state.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <systemd/sd-daemon.h>

#define PERIOD_US 1000000
/* A line of a terminal; names of buses have 31 characters at most. */
#define LINE_MAX_BYTES 240

struct status {
	sd_event_source *timer;
	bool reload_refused;
	char line[LINE_MAX_BYTES];
};

/* One bus beside the others: what is wrong with it, the worst first, and then how busy it is. */
struct judgement {
	const char *name;
	bool down;
	size_t missing; /* drives */
	uint32_t utilisation;
	uint32_t last_error;
};

static bool is_worse(const struct judgement *a, const struct judgement *b)
{
	if (a->down != b->down)
		return a->down;
	if (a->missing != b->missing)
		return a->missing > b->missing;
	return a->utilisation > b->utilisation;
}

static struct judgement judge(const struct plant *plant, const struct plant_bus *bus,
                              size_t *online)
{
	struct db_bus_stats stats;
	size_t drives = 0;

	db_bus_read_stats(bus->bus, &stats);
	for (size_t i = 0; i < plant->drive_count; i++)
		drives += plant->drives[i]->bus == bus;
	*online += stats.online;
	return (struct judgement){
		.name = bus->config->name,
		.down = !stats.up || !stats.port.up,
		.missing = drives > stats.online ? drives - stats.online : 0,
		.utilisation = stats.utilisation,
		.last_error = stats.last_error,
	};
}

static void put_worst(FILE *out, const struct judgement *worst)
{
	fprintf(out, "; worst bus %s: ", worst->name);
	if (worst->down && worst->last_error != 0)
		fprintf(out, "down (%s)", strerror((int)worst->last_error));
	else if (worst->down)
		fprintf(out, "down");
	else if (worst->missing > 0)
		fprintf(out, "%zu drive%s silent", worst->missing, worst->missing == 1 ? "" : "s");
	else
		fprintf(out, "%" PRIu32 " %% busy", worst->utilisation / 10);
}

static void write_line(const struct service *service, FILE *out)
{
	const struct plant *plant = service->plant;
	struct judgement worst = { 0 };
	struct db_server_stats clients;
	size_t online = 0;

	for (size_t b = 0; b < plant->bus_count; b++) {
		struct judgement one = judge(plant, plant->buses[b], &online);

		if (!worst.name || is_worse(&one, &worst))
			worst = one;
	}
	db_server_stats(service->server, &clients);
	fprintf(out, "%zu of %zu drives online, %" PRIu32 " client%s", online, plant->drive_count,
	        clients.clients, clients.clients == 1 ? "" : "s");
	if (worst.name)
		put_worst(out, &worst);
	if (service->status->reload_refused)
		fputs("; the last reload was refused, see the log", out);
}

static void tell(struct service *service)
{
	char line[LINE_MAX_BYTES] = "";
	FILE *out = fmemopen(line, sizeof(line), "w");

	if (!out)
		return;
	write_line(service, out);
	fclose(out);
	line[sizeof(line) - 1] = '\0';
	if (strcmp(line, service->status->line) == 0)
		return;
	memcpy(service->status->line, line, sizeof(line));
	sd_notifyf(0, "STATUS=%s", line);
}

static int on_timer(sd_event_source *source, uint64_t us, void *context)
{
	(void)us;
	tell(context);
	sd_event_source_set_time_relative(source, PERIOD_US);
	return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
}

int status_begin(struct service *service)
{
	int error;

	if (!getenv("NOTIFY_SOCKET"))
		return 0;
	service->status = calloc(1, sizeof *service->status);
	if (!service->status)
		return -ENOMEM;
	error = sd_event_add_time_relative(service->loop, &service->status->timer, CLOCK_MONOTONIC,
	                                   PERIOD_US, PERIOD_US / 4, on_timer, service);
	return error < 0 ? error : 0;
}

void status_reloaded(struct service *service, bool refused)
{
	if (service->status)
		service->status->reload_refused = refused;
}

void status_end(struct service *service)
{
	if (!service->status)
		return;
	sd_event_source_disable_unref(service->status->timer);
	free(service->status);
	service->status = NULL;
}
