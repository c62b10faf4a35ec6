/* SPDX-License-Identifier: Apache-2.0 */
/* /metrics: figures of the service and of this program, for Prometheus. One thread. */
#ifndef DRIVEBRIDGE_WEB_METRICS_H
#define DRIVEBRIDGE_WEB_METRICS_H

#include "web/request.h"

/* Answers with the text, or with an error that says who may read it. */
void db_web_metrics(struct db_web_request *request);

#endif
