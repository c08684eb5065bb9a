import json,time,subprocess
from playwright.sync_api import sync_playwright
A=['--no-sandbox','--use-gl=angle','--use-angle=swiftshader','--enable-unsafe-swiftshader','--disable-quic','--no-first-run','--disable-background-networking','--disable-component-update','--disable-sync']
s=subprocess.Popen(['target/debug/tilefold','serve','big','--port','0'],stdout=subprocess.PIPE,stderr=subprocess.DEVNULL,text=True)
url=s.stdout.readline().strip()
import urllib.request; urllib.request.urlopen(url+'data/versions/2').read()
try:
  with sync_playwright() as p:
    b=p.chromium.launch(executable_path='/usr/bin/chromium',args=A); pg=b.new_page(viewport={'width':1280,'height':800})
    c=pg.context.new_cdp_session(pg); c.send('Performance.enable')
    def m(): 
        d={x['name']:x['value'] for x in c.send('Performance.getMetrics')['metrics']}; return [round(d[k]*1e3) for k in ('ScriptDuration','TaskDuration')]+[round(d['JSHeapUsedSize']/1e6)]
    t=time.time(); pg.goto(url); pg.wait_for_selector('html[data-ready=yes]',state='attached',timeout=60000)
    print(json.dumps({'ready_ms':round((time.time()-t)*1e3),'script_ms task_ms heap_mb':m()}),flush=True)
    for i in range(40):
        time.sleep(0.5)
        if pg.evaluate("tilefold.map.loaded()&&tilefold.map.areTilesLoaded()"): break
    print(json.dumps({'drawn_ms':round((time.time()-t)*1e3),'script_ms task_ms heap_mb':m()}),flush=True)
    a=m(); r=pg.evaluate("(v)=>{const s=document.getElementById('posterior');const t=performance.now();s.value=v;tilefold.state.filters.posterior=v*10;tilefold.state.filter();return performance.now()-t}",80); print(json.dumps({'filter_ms':round(r)}),flush=True)
    pg.evaluate("tilefold.map.jumpTo({zoom:16})"); time.sleep(4)
    r=pg.evaluate("""()=>new Promise(done=>{const g=[];let l=performance.now();const t0=l;let n=0;const f=()=>{const t=performance.now();g.push(t-l);l=t;tilefold.map.panBy([12,6],{duration:0});if(t-t0<6000)requestAnimationFrame(f);else{g.sort((a,b)=>a-b);done([g.length,g[g.length>>1],g[Math.floor(g.length*.95)],g.at(-1)])}};requestAnimationFrame(f)})""")
    print(json.dumps({'pan_zoom16 frames median p95 longest_ms':[round(x,1) for x in r],'script task heap':m()}),flush=True)
    b.close()
finally: s.kill()
