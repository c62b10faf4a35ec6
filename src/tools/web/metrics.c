/* SPDX-License-Identifier: Apache-2.0 */
#include "web/metrics.h"
#include "web/service.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define METRICS_TYPE "text/plain; version=0.0.4; charset=utf-8"
#define ANSWER_WITHIN (10 * DB_NS_PER_S)

struct ticket {
	struct db_web_server *server;
	uint64_t number;
};

static void put(FILE *out, const char *name, const char *kind, const char *help, uint64_t value)
{
	fprintf(out,
	        "# HELP drivebridge_web_%s %s\n# TYPE drivebridge_web_%s %s\n"
	        "drivebridge_web_%s %" PRIu64 "\n",
	        name, help, name, kind, name, value);
}

/* Writes this program's own counters. */
static void put_own(FILE *out, const struct db_web_server *server)
{
	const struct db_web_counts *counts = &server->counts;
	unsigned streams = 0;

	for (const struct db_web_request *one = server->requests; one; one = one->next)
		streams += one->stream != NULL;
	put(out, "service_up", "gauge", "Whether drivebridged is connected.",
	    db_web_service_is_up(server->service));
	put(out, "connections", "gauge", "Connections of browsers.",
	    db_web_connections_count(server->connections));
	put(out, "streams", "gauge", "Streams that are being read.", streams);
	put(out, "requests_total", "counter", "Requests.", counts->requests);
	put(out, "refused_total", "counter", "Requests that were refused.", counts->refused);
	put(out, "logins_total", "counter", "Logins.", counts->logins);
	put(out, "failed_logins_total", "counter", "Logins with a wrong user or password.",
	    counts->failed_logins);
	if (server->tls)
		put(out, "certificate_expires_timestamp_seconds", "gauge",
		    "When the certificate ends, in seconds since 1970.",
		    (uint64_t)server->tls->pair.facts.ends);
	put(out, "jogs_total", "counter", "Motions by a button that was held.", counts->jogs);
	put(out, "late_jogs_total", "counter",
	    "Those that ended because nothing was heard of the button.", counts->late_jogs);
}

static void on_metrics(void *data, json_t *parameters, const struct db_client_error *error,
                       bool more)
{
	struct ticket *ticket = data;
	struct db_web_request *request = db_web_request_find(ticket->server, ticket->number);
	const char *service = json_string_value(json_object_get(parameters, "text"));
	char *text = NULL;
	size_t size = 0;
	FILE *out;

	(void)more;
	out = request ? open_memstream(&text, &size) : NULL;
	if (out) {
		/* Without the service there are still this program's own figures, one of which is
		 * that the service is away. */
		fputs(error || !service ? "" : service, out);
		put_own(out, ticket->server);
		(void)fclose(out);
	}
	if (request)
		db_web_request_answer_text(request, MHD_HTTP_OK, text, METRICS_TYPE);
	free(ticket);
}

static bool may_fetch(const struct db_web_request *request)
{
	const struct db_setting_list *allow = &request->server->config->metrics_allow;

	if (request->session[0] != '\0' && db_grant_has(&request->grant, DB_MAY_LOOK, NULL))
		return true;
	if (allow->word == DB_SETTING_NAMED)
		return db_web_networks_have(allow, &request->address);
	return allow->word == DB_WEB_METRICS_ALL ||
	       (allow->word == DB_WEB_METRICS_LOCAL && db_web_address_is_local(&request->address));
}

void db_web_metrics(struct db_web_request *request)
{
	struct db_link *reader = db_web_service_reader(request->server->service);
	struct ticket *ticket;

	if (!may_fetch(request)) {
		db_web_request_refuse(request, MHD_HTTP_UNAUTHORIZED, "LoginRequired",
		                      "this address may not fetch the metrics without a login");
		return;
	}
	ticket = calloc(1, sizeof(*ticket));
	if (!ticket) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
		return;
	}
	*ticket = (struct ticket){ .server = request->server, .number = request->number };
	request->answer_by = db_client_now() + ANSWER_WITHIN;
	if (!reader || db_link_send(reader, "Metrics", NULL, false, on_metrics, ticket) != 0)
		on_metrics(ticket, NULL, NULL, false);
}
