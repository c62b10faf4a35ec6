/* SPDX-License-Identifier: Apache-2.0 */
/* /metrics: what the service counts and measures, with what this program counts, for Prometheus. One thread. */
#ifndef DRIVEBRIDGE_WEB_METRICS_H
#define DRIVEBRIDGE_WEB_METRICS_H

#include "web/request.h"

/* Answers with the text, or with who may have it. */
void db_web_metrics(struct db_web_request *request);

#endif
